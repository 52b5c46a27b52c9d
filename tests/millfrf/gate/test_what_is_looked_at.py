"""Inspection and report: what the gate refuses of an FRF or a model stands there as a warning."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import write_frf
from millfrf.command_line import DONE, run
from modal_fit import write_modal_model
from replay_data import table_one_model

CONJUGATE = "conjugate the values"
POOR = "the misfit is 7.3 times what the noise explains"


@pytest.fixture
def files(tmp_path: Path) -> list[str]:
    frf = table_one_model().frf(np.arange(5.0, 60.0, 0.25))
    write_frf(tmp_path / "frf.h5", replace(frf, values=frf.values.conj()))
    path = tmp_path / "model.json"
    write_modal_model(path, table_one_model())
    content = json.loads(path.read_text(encoding="utf-8"))
    content["provenance"] = {"step": "fit", "reduced_chi_square": 7.3}
    path.write_text(json.dumps(content), encoding="utf-8")
    return [str(tmp_path / "frf.h5"), str(path)]


def test_inspect_says_it(files: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    for file, message in zip(files, (CONJUGATE, POOR), strict=True):
        assert run(["inspect", file]) == DONE
        assert message in " ".join(capsys.readouterr().out.split())


def test_the_report_shows_it(tmp_path: Path) -> None:
    frf = table_one_model().frf(np.arange(5.0, 60.0, 0.25))
    write_frf(tmp_path / "frf.h5", replace(frf, values=frf.values[:, [1, 0, 2]]))
    assert run(["report", str(tmp_path / "frf.h5"), "--out", str(tmp_path / "r.html")]) == DONE
    assert "TCP gives back" in (tmp_path / "r.html").read_text(encoding="utf-8")
