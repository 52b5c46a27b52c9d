"""The report's advice: certified limits, whatever solver made the file; a recommended cut that the truth survives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from millfrf.core.provenance import of_lobes
from millfrf.cutting import MillingProcess, write_cutting_process
from millfrf.reports.collection import collect
from millfrf.reports.lobes_check import checked_lobes
from millfrf.reports.page import ReportOptions, report_page
from millfrf.reports.recommendation import recommendation
from millfrf.reports.results_page import page_text
from millfrf.reports.sections.stability import stability_findings
from millfrf.stability import certified_lobes, multipliers, write_lobes, zero_order
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
    assert "certified" in findings.brief[0]


@pytest.mark.long
def test_the_more_exact_of_two_files_is_the_headline(tmp_path: Path) -> None:
    paths = files(tmp_path, ("zero-order", "certified"))
    text = page_text(*report_page(collect(paths), ReportOptions()))
    assert "lobes_certified.csv: time-periodic" in text
    assert "lobes_zero-order.csv: averaged coefficients (zero-order)" in text
    findings = stability_findings(collect(paths))
    assert findings.brief[0].startswith("certified: ")
    assert len(findings.warnings) == 1


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
    assert "gives no errors of the coefficients" in advised[0].sentences[0]
    assert "with the errors of the cutting coefficients" in advised[1].sentences[0]
    assert advised[0].cut is not None
    assert advised[1].cut is not None
    assert advised[1].cut.removal < 0.97 * advised[0].cut.removal


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
    head, _ = report_page(collect([tip, other, cut, lobes]), ReportOptions())
    said = " ".join(head.verdict)
    assert "tip.json has 1 modes: 922.00 Hz" in said
    assert "other.json has" not in said
