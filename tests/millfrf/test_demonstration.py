"""The demonstration and the example: the whole chain against the simulated robot's truth."""

import html
import importlib.util
import re
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import millfrf as mf
from estimation import read_frf
from millfrf.demonstration.whole_chain import (
    FIT_BAND,
    SUBSPACE_BAND,
    DemoOptions,
    DemoResult,
    comparison_tables,
    nearest_modes,
    run_demo,
)
from millfrf.steps.diagnose import diagnose, diagnosis_lines
from modal_fit import read_modal_model
from replay_data import default_structure, table_one_model, tip_model

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> DemoResult:
    return run_demo(DemoOptions(tmp_path_factory.mktemp("demo")))


def test_the_three_modes_of_the_band_are_found(demo: DemoResult) -> None:
    pairs = nearest_modes(demo)
    assert len(pairs) == 3
    assert len({result for _, result in pairs}) == 3
    assert demo.identified.mode_sources == ("in-process",) * 3 + ("tapped",) * 2
    assert demo.identified.natural_frequencies == pytest.approx(demo.true.natural_frequencies, rel=0.001)
    for true, result in pairs:
        assert demo.identified.natural_frequencies[result] == pytest.approx(
            demo.true.natural_frequencies[true], rel=0.001
        )
        assert demo.identified.damping_ratios[result] == pytest.approx(demo.true.damping_ratios[true], rel=0.02)


def test_depth_limits_of_the_measured_dynamics_are_within_three_hundredths(demo: DemoResult) -> None:
    true = demo.lobes["true"].depth_limits
    # at 2000 rpm the teeth pass at 67 Hz, outside the band that was measured in the cut: the taps show the modes there
    np.testing.assert_allclose(demo.lobes["identified"].depth_limits, true, rtol=0.03)
    np.testing.assert_allclose(demo.lobes["hammer"].depth_limits, true, rtol=0.10)


def test_a_cut_for_which_zero_order_is_unsafe_does_not_fool_the_tool(demo: DemoResult) -> None:
    trap = demo.trap
    [limit], [true] = trap.certified.depth_limits, trap.true.depth_limits
    assert limit == pytest.approx(true, rel=0.1)
    assert trap.averaged.depth_limits[0] > 1.5 * true
    assert trap.certified.bifurcations == ("period-doubling",)
    assert true < trap.between < trap.averaged.depth_limits[0]
    assert (trap.settled.verdict, trap.chattered.verdict) == ("decays", "grows")
    page = (demo.report.parent / "report_low_immersion.html").read_text(encoding="utf-8")
    assert "is not the stability limit of model_tip.json" in page


def test_tap_calibrated_frf_matches_the_tip_around_the_modes(demo: DemoResult) -> None:
    f = np.linspace(*FIT_BAND, 200)
    true = demo.true.receptance(f)
    error = np.abs(demo.identified.receptance(f) - true)
    assert (error.max(axis=0) <= 0.05 * np.abs(true).max(axis=0)).all()


def test_true_model_is_the_structure_that_was_milled(demo: DemoResult) -> None:
    stored = read_modal_model(demo.report.parent / "true_model_tip.json")
    np.testing.assert_array_equal(stored.poles, tip_model(default_structure()).poles)


def test_its_own_model_explains_its_own_recordings(demo: DemoResult, tmp_path: Path) -> None:
    """The structure has modes at 83 and 127 Hz, and the sensors a high-pass: neither is missing from 13 to 60 Hz."""
    folder = demo.report.parent
    sweeps = sorted((folder / "recordings").glob("sweep_*.h5"))
    diagnosis = diagnose(folder / "model_housing.json", *sweeps, out=tmp_path / "out")
    assert diagnosis.verdict == "none"
    assert diagnosis.physics == ()
    assert diagnosis.details.band.edges == SUBSPACE_BAND
    # beside the noise a model may leave the error that goes with the signal: 0.2 % (decision 42)
    error = diagnosis.improvement
    assert error.before < np.hypot(error.noise_floor, 0.002)
    assert error.before < error.refitted
    assert any("13 to 60 Hz" in line for line in diagnosis_lines(diagnosis))
    assert "13 to 60 Hz" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_tables_and_files_are_there(demo: DemoResult) -> None:
    modes, depths, trap = comparison_tables(demo)
    assert (len(modes.rows), len(depths.rows), len(trap.rows)) == (3, 5, 5)
    folder = demo.report.parent
    assert read_frf(folder / "frf_in_process.h5").quantity == "accelerance"
    page = demo.report.read_text(encoding="utf-8")
    for expected in ("Stability lobes", "Modal model", "Excitation", "16.99", "SHA-256", "data:image/"):
        assert expected in page
    assert "was not made from" not in page  # its files belong together, and they say so
    # nothing is loaded from elsewhere: no tag names another place, and the page forbids what its own scripts hold
    tags = re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)
    assert "Stability lobes" in tags
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", tags)
    assert "default-src 'none'" in html.unescape(tags)


def example_script(name: str) -> Any:
    specification = importlib.util.spec_from_file_location(name, ROOT / "examples" / f"{name}.py")
    assert specification is not None
    assert specification.loader is not None
    example = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(example)
    return example


def test_the_example_draws_lobes_with_cuts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example_script("lobes_and_cuts").main(tmp_path / "picture.png")
    assert "13 of 13 cuts are on the side that collocation says" in capsys.readouterr().out
    assert (tmp_path / "picture.png").stat().st_size > 20_000


def test_the_example_learns_from_cuts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    example = example_script("learned_cuts")
    example.SPEEDS, example.MADE = example.SPEEDS[::15], example.MADE[:4]
    learned = example.main(tmp_path / "picture.png")
    assert "2.4 mm at 660 rpm: hopf" in capsys.readouterr().out
    result = learned.updated()[0].natural_frequencies
    assert abs(result[0] / 16.99 - 1) < 0.015  # the prior is 3 % off
    assert (tmp_path / "picture.png").stat().st_size > 20_000


def test_the_example_finds_the_modes_of_table_1(tmp_path: Path) -> None:
    example = example_script("from_recordings_to_lobes")
    model, lobes = example.limits(example.mill(tmp_path, 60.0))
    truth = table_one_model()
    np.testing.assert_allclose(model.natural_frequencies, truth.natural_frequencies, rtol=0.005)
    np.testing.assert_allclose(model.damping_ratios, truth.damping_ratios, rtol=0.05)
    exact = example.certified_lobes(truth, replace(example.CUTTER), lobes.spindle_speeds, 10e-3)
    np.testing.assert_allclose(lobes.depth_limits, exact.depth_limits, rtol=0.03)


def test_the_notebook_of_the_readme_runs_and_prints_what_it_says(
    demo: DemoResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    [code] = re.findall(r"```python\n(import millfrf as mf\n.*?)```", text, flags=re.DOTALL)
    assert len([line for line in code.splitlines() if line]) <= 10
    [printed] = re.findall(r"```text\n(Estimate by .*?)```", text, flags=re.DOTALL)
    (tmp_path / "millfrf-demo").symlink_to(demo.report.parent)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "agg")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", mf.MillfrfWarning)
        names: dict[str, Any] = {}
        exec(compile(code, "README.md", "exec"), names)
    assert capsys.readouterr().out == printed
    assert (tmp_path / "lobes.png").stat().st_size > 10_000
    result, true = names["fitted"].model.natural_frequencies, demo.true.natural_frequencies
    np.testing.assert_allclose(result, sorted(true)[: len(result)], rtol=2e-3)
