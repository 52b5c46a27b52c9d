"""Lobes of a model that holds in a narrow band: what lies outside is said, on the terminal and in the file."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import DONE, run
from millfrf.core import Band
from millfrf.cutting import write_cutting_process
from millfrf.stability import read_lobes
from millfrf.steps.lobes import compute_lobes, speed_axis
from modal_fit import ModalModel, Residuals, write_modal_model
from replay_data import ACETAL_CUTTER, default_structure, tip_model


def fitted(band: Band | None) -> ModalModel:
    """The two modes of the tip near 18 Hz, as a fit from 12 to 24 Hz gives them."""
    whole = tip_model(default_structure())
    low = whole.natural_frequencies < 24.0
    return replace(whole, poles=whole.poles[low], right=whole.right[low], left=whole.left[low], band=band)


def warnings(band: Band | None, lowest: float, highest: float, count: int = 5) -> str:
    lobes = compute_lobes(fitted(band), ACETAL_CUTTER, speed_axis(lowest, highest, count), 0.05, "zero-order")
    return " ".join(text for text in lobes.warnings if "in which the structure was measured" in text)


def test_a_speed_far_above_the_band_is_said() -> None:
    said = warnings((12.0, 24.0), 6000, 6000, 1)
    assert "1 of 1 speeds (6000 rpm)" in said
    assert "the teeth pass at 200 Hz, beyond the 12 to 24 Hz in which the structure was measured" in said


def test_chatter_outside_the_band_is_said() -> None:
    said = warnings((17.5, 18.5), 800, 2400)
    assert "the chatter frequency" in said
    assert "lies outside the 17.5 to 18.5 Hz in which the structure was measured" in said


@pytest.mark.parametrize("band", [None, (0.2, 5000.0)])
def test_a_wide_or_unknown_band_is_not_doubted(band: Band | None) -> None:
    assert warnings(band, 6000, 6000, 1) == ""


def test_averaged_coefficients_rest_on_the_same_modes() -> None:
    """They hide the harmonics that reach beyond the band, and the modes there."""
    assert "the teeth pass at 26.67 to 80 Hz, beyond the 13 to 25 Hz" in warnings((13.0, 25.0), 300, 2400, 22)


@pytest.mark.parametrize(("band", "doubted"), [((13.0, 25.0), True), ((2.0, 500.0), False)])
def test_harmonics_outside_the_band_that_move_a_limit_are_said(band: Band, doubted: bool) -> None:
    speeds = speed_axis(1000, 1400, 5)
    whole = replace(tip_model(default_structure()), band=(2.0, 500.0))
    known = compute_lobes(whole if band[1] > 100 else fitted(band), ACETAL_CUTTER, speeds, 0.01)
    said = " ".join(text for text in known.warnings if "in which the structure was measured" in text)
    assert bool(said) is doubted
    truth = compute_lobes(whole, ACETAL_CUTTER, speeds, 0.01).depth_limits
    off = np.abs(known.depth_limits / truth - 1).max()
    assert bool(off > 0.05) is doubted


def test_an_frf_without_a_band_holds_on_its_valid_lines() -> None:
    axis = np.arange(1.0, 60.0, 0.25)
    frf = fitted(None).frf(axis)
    narrow = replace(frf, valid=(axis > 12) & (axis < 24))
    lobes = compute_lobes(narrow, ACETAL_CUTTER, speed_axis(6000, 6000, 1), 0.05, "zero-order")
    assert "beyond the 12.25 to 23.75 Hz" in " ".join(lobes.warnings)


def test_the_doubt_reaches_terminal_file_and_reader(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_modal_model(tmp_path / "m.json", fitted((12.0, 24.0)))
    write_cutting_process(tmp_path / "cut.toml", ACETAL_CUTTER)
    out = tmp_path / "lobes.csv"
    code = run(
        ["lobes", str(tmp_path / "m.json"), "--cutting", str(tmp_path / "cut.toml"), "--speeds", "5800", "6000", "2"]
        + ["--max-depth", "0.05", "--method", "zero-order", "--out", str(out)]
    )
    assert code == DONE
    assert "warning: at 2 of 2 speeds (5800 to 6000 rpm) the teeth pass" in capsys.readouterr().err
    assert any("the teeth pass at" in text for text in read_lobes(out).warnings)


def test_a_limit_beyond_the_band_is_not_verified() -> None:
    model = fitted((12.0, 24.0))
    speeds = speed_axis(600, 6600, 3)
    lobes = compute_lobes(model, ACETAL_CUTTER, speeds, 0.05)
    assert lobes.numerics == ("verified",) * 3
    # the teeth pass at 120 and 220 Hz, and a limit there is far above the lowest or none at all
    assert lobes.band[1:] == lobes.status[1:] == ("unmeasured",) * 2
    assert any("measure up to 440 Hz (tap the tip), or lower the speed" in text for text in lobes.warnings)
    whole = compute_lobes(replace(model, band=None), ACETAL_CUTTER, speeds, 0.05)
    assert whole.status == ("verified",) * 3
    assert whole.band == ("not-stated",) * 3
    np.testing.assert_array_equal(whole.depth_limits, lobes.depth_limits)


@pytest.mark.parametrize(("inertance", "remedy"), [(0.0, "hit each direction"), (0.03, "hit harder and more often")])
def test_the_remedy_is_that_of_the_part_that_takes_most(inertance: float, remedy: str) -> None:
    """Cross terms were not measured; but where taps are as noisy as that, to measure them would change little."""
    whole = tip_model(default_structure())
    size = (len(whole.responses), len(whole.excitations))
    rest = Residuals(np.zeros(size), inertance * np.eye(*size))
    along = np.eye(3)[[0, 1, 0, 1, 2]]  # each mode moves along one axis
    modes = {"right": along * whole.right, "left": along * whole.left}
    tapped = replace(whole, band=(2.0, 500.0), measured=np.eye(*size, dtype=bool), residuals=rest, **modes)
    lobes = compute_lobes(tapped, ACETAL_CUTTER, speed_axis(1000, 1400, 3), 0.1)
    [said] = [text for text in lobes.warnings if "may move the limit by more than 5 %" in text]
    assert remedy in said
