"""The report's advice: certified limits, whatever solver made the file; a recommended cut that the truth survives."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import write_frf
from millfrf.core import accepting_edited
from millfrf.core.provenance import add_to_json, of_lobes, origin
from millfrf.cutting import MillingProcess, write_cutting_process
from millfrf.reports.collection import collect
from millfrf.reports.lobes_check import checked_lobes
from millfrf.reports.page import ReportOptions, report_of
from millfrf.reports.recommendation import recommendation, shown_depth
from millfrf.reports.results_page import page_text
from millfrf.reports.sections.stability import stability_findings
from millfrf.stability import StabilityLobes, certified_lobes, multipliers, write_lobes, zero_order
from modal_fit import ModalModel, write_modal_model

RPM = np.pi / 30
HALF = MillingProcess(2, 0.01, np.pi / 2, 6e8, 1 / 3, 0.0, np.pi / 2, np.pi, 0.1e-3)
"""Half-immersion down-milling of the 1-degree-of-freedom benchmark (922 Hz)."""


def structure() -> ModalModel:
    """The benchmark's structure, its frequency known to 0.1 %, its damping and size to 2 %; rigid in Y and Z."""
    turn, zeta, mass = 2 * np.pi * 922, 0.011, 0.03993
    pole = turn * (-zeta + 1j * np.sqrt(1 - zeta**2))
    right = np.array([[1 / (mass * 2j * pole.imag)]])
    sizes = np.array([0.02 * turn * zeta, 0.001 * turn, 0.0, 0.02 * abs(right[0, 0]), 0.0, 0.0])
    axes = ("TCP:+X",)
    return ModalModel(np.array([pole]), right, np.ones((1, 1)) + 0j, axes, axes, covariance=np.diag(sizes**2))


def files(folder: Path, methods: tuple[str, ...], cut: MillingProcess = HALF) -> list[Path]:
    speeds, model = np.linspace(26000, 36000, 101) * RPM, structure()
    paths = [folder / "tip.json", folder / "cut.toml"]
    write_modal_model(paths[0], model)
    write_cutting_process(paths[1], cut)
    for method in methods:
        solver = {"zero-order": zero_order, "certified": certified_lobes}[method]
        paths.append(folder / f"lobes_{method}.csv")
        write_lobes(paths[-1], solver(model, cut, speeds, 12e-3))
    return paths


@pytest.mark.long
def test_zero_order_lobes_do_not_make_the_advice(tmp_path: Path) -> None:
    """It said 9.72 mm at 31917 rpm, where the cut doubles its period from 7.05 mm on."""
    collected = collect(files(tmp_path, ("zero-order",)))
    [checked] = checked_lobes(collected)
    assert checked.wrong
    assert "averaged" in checked.method
    advised = recommendation(checked)
    assert advised.cut is not None
    for drift in (-0.02, 0.0, 0.02):
        speed = advised.cut.spindle_speed * (1 + drift)
        assert multipliers(structure(), HALF, speed, advised.cut.depth).stable
    assert any("decays" in line for line in advised.sentences)
    findings = stability_findings(collected)
    assert any("not the stability limit" in line and "period doubling" in line for line in findings.warnings)
    assert findings.answer[0].startswith("Cut ")
    assert "certified" in findings.section.sentences[0]


@pytest.mark.long
def test_the_more_exact_of_two_files_is_the_headline(tmp_path: Path) -> None:
    paths = files(tmp_path, ("zero-order", "certified"))
    report = report_of(collect(paths), ReportOptions())
    text = page_text(report.page, report.sections)
    assert "lobes_certified.csv: time-periodic" in text
    assert "lobes_zero-order.csv: averaged coefficients (zero-order)" in text
    findings = stability_findings(collect(paths))
    assert findings.section.sentences[0].startswith("certified: ")
    assert len(findings.warnings) == 2  # the wrong file, and coefficients without errors


@pytest.mark.long
def test_coefficients_errors_are_named_where_they_are_missing_and_used_where_not(tmp_path: Path) -> None:
    advised = []
    for std in (0.0, 0.1):
        (tmp_path / str(std)).mkdir()
        cut = replace(HALF, ktc_std=std * HALF.ktc)
        [checked] = checked_lobes(collect(files(tmp_path / str(std), ("certified",), cut)))
        assert checked.process is not None
        assert checked.process.ktc_std == pytest.approx(std * HALF.ktc)
        advised.append(recommendation(checked))
    assert "gives no errors of the coefficients" in advised[0].warnings[0]
    assert not advised[1].warnings
    assert advised[0].cut is not None
    assert advised[1].cut is not None
    assert advised[1].cut.removal < advised[0].cut.removal  # in a pocket without a limit, so by little
    assert advised[0].band is not None
    assert advised[1].band is not None
    known = np.isfinite(advised[0].band.low) & np.isfinite(advised[1].band.low)
    assert known.any()
    # limits fall as 1 / K_tc: two standard errors of 10 % are a fifth
    assert np.median(advised[1].band.low[known] / advised[0].band.low[known]) < 0.9


def test_limits_of_exactly_these_files_are_not_computed_again(tmp_path: Path) -> None:
    """Unless edited files are accepted: then no file need hold what it states."""
    paths = files(tmp_path, ())
    limits = certified_lobes(structure(), HALF, np.linspace(26000, 36000, 31) * RPM, 12e-3)
    stated = of_lobes(paths, {"method": "certified", "max_depth_m": 12e-3})
    write_lobes(tmp_path / "lobes.csv", limits, provenance=stated)
    collected = collect([*paths, tmp_path / "lobes.csv"])
    [checked] = checked_lobes(collected)
    assert checked.certified is checked.given
    with accepting_edited():
        [again] = checked_lobes(collected)
    assert again.certified is not again.given
    assert again.certified is not None
    np.testing.assert_allclose(again.certified.depth_limits, again.given.depth_limits, rtol=1e-6)


def test_a_file_of_another_structure_is_doubted(tmp_path: Path) -> None:
    paths = files(tmp_path, ("certified",))
    write_cutting_process(paths[1], replace(HALF, ktc=2 * HALF.ktc))
    assert any("could not be checked" in line for line in stability_findings(collect(paths)).warnings)


def test_the_model_of_the_lobes_stands_at_the_head(tmp_path: Path) -> None:
    """Another model that is given after it does not."""
    tip, cut, lobes = files(tmp_path, ("certified",))
    other = tmp_path / "other.json"
    write_modal_model(other, replace(structure(), poles=1.1 * structure().poles))
    solved = certified_lobes(structure(), HALF, np.array([30000.0, 31000.0]) * RPM, 12e-3)
    write_lobes(lobes, solved, provenance=of_lobes([tip, cut], {}))
    head = report_of(collect([tip, other, cut, lobes]), ReportOptions()).page
    said = " ".join(head.verdict)
    assert "1 mode: 922.00 Hz" in said
    assert "1014" not in said


def two_modes() -> ModalModel:
    """The benchmark's structure with a second mode at 1071 Hz, both in X."""
    first = structure()
    second = replace(first, poles=first.poles * 1071 / 922)
    poles, right, left = (
        np.concatenate(pair)
        for pair in ((first.poles, second.poles), (first.right, second.right), (first.left, second.left))
    )
    return replace(first, covariance=None, poles=poles, right=right, left=left)


def test_no_cut_is_recommended_for_a_tip_that_gives_back_power(tmp_path: Path) -> None:
    """Sensors whose names are exchanged gave a cut that chatters, with 97.5 % confidence."""
    tip, cut, lobes = files(tmp_path, ("certified",))
    own, axes = structure(), ("TCP:+X", "TCP:+Y")
    shapes = np.array([[0.9, 0.4], [-0.4, 0.9]])
    poles = own.poles * np.array([1.0, 1.3])
    right, left = own.right[0, 0] * shapes[:, ::-1], shapes + 0j
    both = ModalModel(poles, right, left, axes, axes, band=(200.0, 6000.0))
    write_modal_model(tip, both)
    write_lobes(
        lobes,
        certified_lobes(both, HALF, np.array([30000.0, 31000.0]) * RPM, 12e-3),
        provenance=of_lobes([tip, cut], {}),
    )
    findings = stability_findings(collect([tip, cut, lobes]))
    assert any(text.startswith("No cut is recommended, and no limit is to be trusted") for text in findings.warnings)


def test_limits_of_a_model_that_lacks_a_mode_are_compared_with_its_frf(tmp_path: Path) -> None:
    """A fit that lost a mode gave other limits than the FRF it was fitted to, and nothing said so."""
    tip, cut, lobes = files(tmp_path, ("certified",))
    frf = tmp_path / "tip.h5"
    write_frf(frf, two_modes().frf(np.arange(200.0, 6000.0, 2.0)))
    add_to_json(tip, origin("fit", [frf]))
    findings = stability_findings(collect([frf, tip, cut, lobes]))
    [gap] = [text for text in findings.warnings if "have different limits at" in text]
    assert "tip.json and tip.h5" in gap
    assert "the fit misses a mode" in gap
    assert any("The recommended cut is withdrawn: the model allows" in text for text in findings.warnings)
    write_frf(frf, structure().frf(np.arange(200.0, 6000.0, 2.0)))
    write_modal_model(tip, structure())
    add_to_json(tip, origin("fit", [frf]))
    findings = stability_findings(collect([frf, tip, cut, lobes]))
    assert not any("to which it was fitted" in text for text in findings.warnings)


@pytest.mark.parametrize("stiffness", [1.0, 1e4])
def test_lobes_without_any_limit_are_checked_like_others(tmp_path: Path, stiffness: float) -> None:
    """They were said to belong to no structure; limits that the structure has were not compared with them."""
    tip, cut, lobes = files(tmp_path, ("certified",))
    write_modal_model(tip, replace(structure(), right=structure().right / stiffness, covariance=None))
    speeds = np.array([28000.0, 30000.0, 32000.0]) * RPM
    free = StabilityLobes(speeds, np.full(3, np.inf), np.full(3, np.nan), ("none",) * 3, "collocation")
    write_lobes(lobes, free, provenance=of_lobes([tip, cut], {"max_depth_m": 0.012}))
    [checked] = checked_lobes(collect([tip, cut, lobes]))
    if stiffness > 1:
        assert checked.structure is not None
        assert checked.max_depth == 0.012
        assert not checked.wrong
    else:
        assert any("could not be checked" in text for text in stability_findings(collect([tip, cut, lobes])).warnings)


def test_a_cut_beyond_the_band_is_recommended_less_what_is_not_measured(tmp_path: Path) -> None:
    tip, cut, lobes = files(tmp_path, ("certified",))
    speeds = np.array([30000.0, 31000.0, 32000.0]) * RPM
    depths = []
    for flexibility in (0.0, 2e-7):
        model = replace(structure(), band=(200.0, 1500.0), unmeasured_flexibility=flexibility)
        write_modal_model(tip, model)
        write_lobes(lobes, certified_lobes(model, HALF, speeds, 12e-3), provenance=of_lobes([tip, cut], {}))
        [checked] = checked_lobes(collect([tip, cut, lobes]))
        advised = recommendation(checked)
        assert advised.cut is not None
        depths.append(advised.cut.depth)
    assert depths[1] < 0.9 * depths[0]
    said = " ".join(advised.sentences)
    assert "Modes outside the 200 to 1500 Hz in which the structure was measured" in said
    assert "measure up to" in said
    assert re.match("Measure more before you cut: what was not measured takes 9[0-9] %", advised.headline[0])


def test_a_recommended_depth_is_shown_rounded_down() -> None:
    """A depth of 0.1455 mm was shown as 0.15 mm, which is not stable with the stated confidence."""
    for depth in np.random.default_rng(1).uniform(-6, -1, 300):
        shown = float(shown_depth(10.0**depth).removesuffix(" mm"))
        assert 0.99 * 1e3 * 10.0**depth < shown <= 1e3 * 10.0**depth * (1 + 1e-9)
    assert [shown_depth(1e-3 * depth) for depth in (0.1459, 12.0, 0.3, 99.99)] == [
        "0.145 mm",
        "12.0 mm",
        "0.300 mm",
        "99.9 mm",
    ]
