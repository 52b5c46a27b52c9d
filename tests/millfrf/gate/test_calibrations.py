"""Tip against sensor: one FRF given twice, both exchanged, taps that miss a mode."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import Frf, write_frf
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import Band
from millfrf.core.provenance import read_provenance
from modal_fit import ModalModel, write_modal_model
from replay_data import default_structure

AXIS = np.arange(1.0, 60.0, 0.125)


def at(node: str, label: str | None = None) -> ModalModel:
    """The cell's structure, moved where ``node`` is and excited at the tip; ``label``: what the file calls it."""
    whole = default_structure()
    rows = [k for k, name in enumerate(whole.responses) if name.startswith(f"{node}:")]
    columns = [k for k, name in enumerate(whole.excitations) if name.startswith("TCP:")]
    low = whole.natural_frequencies < 30.0
    return replace(
        whole,
        poles=whole.poles[low],
        right=whole.right[low][:, rows],
        left=whole.left[low][:, columns],
        responses=tuple(whole.responses[k].replace(node, label or node) for k in rows),
        excitations=tuple(whole.excitations[k] for k in columns),
    )


def tapped(node: str, seed: int, label: str | None = None, band: Band | None = None) -> Frf:
    exact = at(node, label).frf(AXIS)
    noise = np.random.default_rng(seed).standard_normal((2, *exact.values.shape)) * 1e-3 * np.abs(exact.values).max()
    return replace(exact, values=exact.values + noise[0] + 1j * noise[1], band=band)


def calibrate(folder: Path, tip: Frf, sensor: Frf, model: ModalModel | None = None) -> int:
    write_modal_model(folder / "model.json", replace(model or at("HOUSING"), band=(13.0, 30.0)))
    write_frf(folder / "tt.h5", tip)
    write_frf(folder / "st.h5", sensor)
    files = ["--tip", str(folder / "tt.h5"), "--sensor", str(folder / "st.h5"), "--out", str(folder / "tip.json")]
    return run(["calibrate", str(folder / "model.json"), *files])


def test_one_frf_as_tip_and_sensor_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    single = tapped("HOUSING", 1)
    assert calibrate(tmp_path, single, single) == BAD_INPUT
    said = capsys.readouterr().err
    assert "tt.h5 and st.h5 hold the same values: one FRF was given as tip and as sensor" in said
    assert not (tmp_path / "tip.json").exists()


def test_the_same_values_under_another_name_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tip = tapped("TCP", 1)
    assert calibrate(tmp_path, tip, replace(tip, responses=at("HOUSING").responses)) == BAD_INPUT
    assert "one FRF was given as tip and as sensor" in capsys.readouterr().err


def test_tip_and_sensor_exchanged_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrate(tmp_path, tapped("HOUSING", 1), tapped("TCP", 2)) == BAD_INPUT
    assert "tip and sensor are exchanged; swap --tip and --sensor" in capsys.readouterr().err


def test_places_that_cannot_be_told_apart_are_doubted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tip, sensor = tapped("TCP", 1, "HEAD"), tapped("HOUSING", 2, "HEAD")
    assert calibrate(tmp_path, tip, sensor, at("HOUSING", "HEAD")) == DONE
    assert "both state that they are measured at HEAD:+X" in capsys.readouterr().err
    assert any("both state" in text for text in read_provenance(tmp_path / "tip.json")["warnings"])


def test_a_mode_that_was_not_tapped_is_doubted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrate(tmp_path, tapped("TCP", 1, band=(17.5, 50.0)), tapped("HOUSING", 2)) == DONE
    assert "1 of 2 modes of the model (at 16.99 Hz) lie outside the 17.5 to 50 Hz" in capsys.readouterr().err


def test_two_sound_measurements_are_not_doubted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert calibrate(tmp_path, tapped("TCP", 1, band=(2.0, 55.0)), tapped("HOUSING", 2, band=(2.0, 58.0))) == DONE
    assert "warning" not in capsys.readouterr().err


def test_all_accelerations_in_g_are_doubted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A unit that is wrong in every file alike: only the tip's apparent mass shows it."""
    model, g = at("HOUSING"), 9.80665
    tip, sensor = (replace(frf, values=frf.values / g) for frf in (tapped("TCP", 1), tapped("HOUSING", 2)))
    assert calibrate(tmp_path, tip, sensor, replace(model, right=model.right / g)) == DONE
    said = capsys.readouterr().err
    assert "were accelerations in g called m/s^2 in all files?" in said
    true = at("TCP")
    mass = 1 / np.sum(2 * true.poles.imag[:, None] * np.abs(true.right * true.left), axis=0)
    named = [float(text.split()[-2]) for text in said.split(" at TCP:")[:3]]
    assert named == pytest.approx(g * mass, rel=0.02)


@pytest.mark.parametrize(("corner", "says"), [(0.0, None), (5.0, "leads that in the taps"), (-5.0, "lags that in")])
def test_a_high_pass_in_one_of_the_two_tests_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], corner: float, says: str | None
) -> None:
    """A first-order high-pass turns a mode at f by atan(corner / f); behind it in the taps, by as much back."""
    model = at("HOUSING")
    turn = np.exp(1j * np.arctan(corner / model.natural_frequencies))[:, None]
    assert calibrate(tmp_path, tapped("TCP", 1), tapped("HOUSING", 2), replace(model, right=turn * model.right)) == DONE
    printed = capsys.readouterr().err
    assert (says in printed) if says else ("every mode" not in printed)
    if says:
        assert f"{np.degrees(np.arctan(5 / model.natural_frequencies[0])):.0f}° at" in printed
