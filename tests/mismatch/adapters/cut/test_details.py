"""The files of a diagnosis: what is written is read back, and the improved cutting file holds the truth."""

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from small_cut import PROCESS, small_cut, stated

from millfrf.cutting import read_cutting_process
from millfrf.mismatch import AcceptedCause, Diagnosis, read_diagnosis, write_diagnosis, write_improved_cut
from millfrf.mismatch.cut.diagnose_cut import CutDetails
from millfrf.mismatch.cut.fitting import fit_cut
from millfrf.mismatch.cut.recordings import CutChatter
from millfrf.mismatch.cut.settings import CUT
from millfrf.mismatch.inference.diagnosis import Improvement, Remainder


def _diagnosis() -> Diagnosis[CutDetails]:
    truth = stated(np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0]), runout=[12e-6], process_damping=[2e5])
    cut = small_cut(truth, noise=1e-3)
    base = fit_cut(cut, stated())
    final = fit_cut(cut, truth, ("runout", "process_damping"))
    chatter = (CutChatter("cut0", "stable", math.nan, 0.0, "nothing but the tooth passing"),)
    details = CutDetails(cut, base, base, final, chatter, CUT)
    cause = AcceptedCause("runout", {}, {"radial_offset_m": 12e-6, "angle_rad": 0.2}, {"radial_offset_m": 1e-7}, 99.0)
    gain = Improvement("every other block", 0.3, 0.2, 0.1, 0.1, 1e-4, (0.3, 0.4), 50.0)
    left = (Remainder(0.5, 2.0), Remainder(0.01, 0.1))
    return Diagnosis("cut", "explained", (cause,), (), (), gain, *left, {"spindle_orders": [1]}, details,
                     content={"cut": details.content()})  # fmt: skip


def test_a_written_diagnosis_reads_back(tmp_path: Path) -> None:
    diagnosis = _diagnosis()
    write_diagnosis(tmp_path / "d.json", diagnosis)
    again = read_diagnosis(tmp_path / "d.json")
    assert again == replace(diagnosis, details=None, content=again.content)
    cut = again.content["cut"]
    assert cut["depth_m"] == 1e-3
    assert cut["recordings"][0]["spindle_speed_rpm"] == pytest.approx(84.0 * 30 / math.pi, rel=1e-4)
    assert cut["recordings"][0]["channels"] == ["TCP:+X", "TCP:+Y", "TCP:+Z"]
    assert cut["chatter"][0]["frequency_hz"] is None


def test_a_pickle_comes_back_with_its_fits() -> None:
    diagnosis = _diagnosis()
    again = pickle.loads(pickle.dumps(diagnosis))
    assert again == diagnosis
    assert again.details.improved_process() == diagnosis.details.improved_process()
    assert again != replace(diagnosis, details=replace(diagnosis.details, chatter=()))


def test_the_improved_cutting_file_holds_the_truth(tmp_path: Path) -> None:
    write_improved_cut(tmp_path / "cut.toml", _diagnosis())
    improved = read_cutting_process(tmp_path / "cut.toml")
    assert improved.ktc == pytest.approx(PROCESS.ktc * math.exp(0.5 * 0.15), rel=1e-4)
    assert improved.runout == pytest.approx(12e-6, rel=1e-3)
    assert improved.process_damping == pytest.approx(2e5, rel=1e-3)
    text = (tmp_path / "cut.toml").read_text(encoding="utf-8")
    assert "refitted to cut0; verdict explained, causes: runout" in text
    assert "runout points 0.2 rad from tooth 0" in text
