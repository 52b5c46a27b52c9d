"""The tutorials, typed line by line as they stand, give what they say."""

import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest

from acquisition import Recording
from estimation import read_frf
from millfrf.new.mapping_file import new_mapping
from millfrf.stability import read_lobes
from modal_fit import read_modal_model
from tests.docs.page_runner import ROOT, run_page


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _run(name: str) -> int:
    return run_page((ROOT / "docs" / "tutorials" / f"{name}.md").read_text(encoding="utf-8"))


@pytest.mark.long
def test_from_mat_files_to_a_safe_cut(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _run("mat_to_cut") == 7
    assert "clock" not in capsys.readouterr().err
    there = folder / "lab-files"
    model = read_modal_model(there / "at_tip.json")
    # the cuts excite three modes, the taps two above them
    np.testing.assert_allclose(model.natural_frequencies, [16.99, 18.48, 52.0, 83.0, 127.0], rtol=2e-3)
    np.testing.assert_allclose(model.damping_ratios, [0.0285, 0.0996, 0.04, 0.03, 0.025], rtol=1e-2)
    lobes = read_lobes(there / "lobes.csv")
    at_1200 = np.argmin(np.abs(lobes.spindle_speeds - 1200 * np.pi / 30))
    assert lobes.depth_limits[at_1200] == pytest.approx(2.35e-3, rel=0.02)
    assert (there / "report.html").stat().st_size > 1e5


def test_a_csv_file_with_a_row_of_units(folder: Path) -> None:
    _run("csv")
    with Recording(folder / "lab-files" / "cut.h5") as recording:
        stream = recording.stream()
        assert (stream.sample_rate, stream.channels[0].unit, stream.channels[3].unit) == (1024.0, "N", "m/s^2")
        assert 15 < np.abs(stream.read(0, 30720)[:, 0]).max() < 25  # the page shows 19.81 N


@pytest.mark.long
def test_uff_and_tdms(folder: Path) -> None:
    _run("uff_tdms")
    model = read_modal_model(folder / "lab-files" / "model.json")
    np.testing.assert_allclose(model.natural_frequencies, [16.99, 18.48, 52.0], rtol=1e-3)
    with Recording(folder / "lab-files" / "cut.h5") as recording:
        assert recording.stream().sample_rate == 1024.0


def test_a_hammer_test(folder: Path) -> None:
    _run("hammer_test")
    assert read_frf(folder / "lab-files" / "tip.h5").values.shape[1:] == (3, 3)
    model = read_modal_model(folder / "lab-files" / "tip.json")
    np.testing.assert_allclose(model.natural_frequencies, [16.99, 18.48, 52.0], rtol=5e-3)


@pytest.mark.parametrize(("name", "result"), [("recording", "first.h5"), ("robots", "mine.toml")])
def test_a_short_tutorial(folder: Path, name: str, result: str) -> None:
    assert _run(name) >= 3
    assert (folder / result).stat().st_size > 100


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "result"),
    [
        ("three_immersions", "report.html"),
        ("diagnosing", "predicted.h5"),
        ("campaign", "trial/campaign_results/summary/modes.csv"),
    ],
)
def test_a_longer_tutorial(folder: Path, name: str, result: str) -> None:
    assert _run(name) >= 3
    assert Path(result).stat().st_size > 100


def test_the_mappings_that_ship_differ_from_the_templates_by_what_the_reader_fills_in(folder: Path) -> None:
    """Names, arrays and columns are those that `millfrf new mapping` proposes."""
    runpy.run_path(str(ROOT / "examples" / "lab_files.py"))["write_lab_files"](folder, 1.0)
    for source, name in (("cut_down.mat", "cuts"), ("hit_x.mat", "hits")):
        proposed = tomllib.loads(new_mapping(folder / source).text)
        filled = tomllib.loads((ROOT / "examples" / f"lab_{name}.toml").read_text(encoding="utf-8"))
        assert proposed["sample_rate"] == filled["sample_rate"]
        for given, complete in zip(proposed["channels"], filled["channels"], strict=True):
            assert given.items() <= complete.items()
            assert set(complete) - set(given) <= {"unit", "quantity"}
