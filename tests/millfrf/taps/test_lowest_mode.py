"""The lowest mode that a user states at the fit: kept in the model, contradicted by a lower mode, used by lobes."""

from pathlib import Path

import numpy as np
import pytest

from estimation import write_frf
from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.stability import unmeasured_dynamics
from modal_fit import read_modal_model
from replay_data import table_one_model


@pytest.fixture
def frf(tmp_path: Path) -> str:
    path = tmp_path / "frf.h5"
    write_frf(path, table_one_model().frf(np.arange(8.0, 60.0, 0.25)))
    return str(path)


def test_it_travels_with_the_model(frf: str, tmp_path: Path) -> None:
    out = str(tmp_path / "model.json")
    assert run(["fit", frf, "--lowest-mode", "9", "--out", out]) == DONE
    model = read_modal_model(out)
    assert model.lowest_mode == 9.0
    unmeasured = unmeasured_dynamics(model)
    assert unmeasured is not None
    assert unmeasured.lowest_mode == 9.0
    assert unmeasured.inertance == 0.0


def test_a_mode_below_it_contradicts(frf: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "model.json"
    assert run(["fit", frf, "--lowest-mode", "40", "--out", str(out)]) == BAD_INPUT
    assert "contradicts the fit" in capsys.readouterr().err
    assert not out.exists()
