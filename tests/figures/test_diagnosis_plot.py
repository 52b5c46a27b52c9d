"""A diagnosis tells its verdict, causes and errors, draws them, and comes back from its file."""

import pickle
from pathlib import Path

import matplotlib.pyplot as plt

import millfrf as mf
from millfrf.mismatch import AcceptedCause, write_diagnosis
from millfrf.mismatch.inference.diagnosis import Improvement, Remainder


def _diagnosis() -> "mf.Diagnosis[None]":
    cause = AcceptedCause("coulomb_friction", {"modes": [1]}, {"force": 3.5}, {"force": 0.1}, 812.0)
    gain = Improvement("high", 0.12, 0.1, 0.02, 0.015, 1e-6, (0.1, 0.2))
    left = (Remainder(0.4, 2.0), Remainder(0.01, 0.1))
    return mf.Diagnosis("structure", "explained", (cause,), (), (), gain, *left, {}, None, doubts=("<b>one</b> level",))


def test_a_diagnosis_tells_and_draws_its_errors(tmp_path: Path) -> None:
    diagnosis = _diagnosis()
    assert repr(diagnosis).splitlines() == [
        "Diagnosis of a structure: explained",
        "  coulomb_friction (modes [1])",
        "  error on high: 12 % nominal, 2 % improved, 1.5 % noise",
        "  1 warning: <b>one</b> level",
    ]
    assert "<b>one" not in diagnosis._repr_html_()
    assert pickle.loads(pickle.dumps(diagnosis)) == diagnosis
    with plt.style.context("default"):
        plt.switch_backend("agg")
        axes = diagnosis.plot()
    assert [bar.get_width() for bar in axes.patches] == [12.0, 10.0, 2.0]
    assert axes.get_title() == "Verdict: explained"
    write_diagnosis(tmp_path / "diagnosis.json", diagnosis)
    again = mf.open(tmp_path / "diagnosis.json")
    assert repr(again) == repr(diagnosis)
    axes.figure.savefig(tmp_path / "diagnosis.png")
    plt.close("all")
