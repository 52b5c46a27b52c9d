"""The lowest mode that a user states at the fit: kept in the model, contradicted by a lower mode, used by lobes."""

from pathlib import Path

import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.stability import unmeasured_dynamics
from modal_fit import read_modal_model


def test_it_travels_with_the_model(simulated_frf: str, tmp_path: Path) -> None:
    out = str(tmp_path / "model.json")
    assert run(["fit", simulated_frf, "--lowest-mode", "9", "--out", out]) == DONE
    model = read_modal_model(out)
    assert model.lowest_mode == 9.0
    unmeasured = unmeasured_dynamics(model)
    assert unmeasured is not None
    assert unmeasured.lowest_mode == 9.0
    assert unmeasured.inertance == 0.0


def test_a_mode_below_it_contradicts(simulated_frf: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "model.json"
    assert run(["fit", simulated_frf, "--lowest-mode", "40", "--out", str(out)]) == BAD_INPUT
    assert "contradicts the fit" in capsys.readouterr().err
    assert not out.exists()
