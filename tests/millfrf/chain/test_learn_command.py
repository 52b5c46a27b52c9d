"""`millfrf learn`: from a model, coefficients and cuts to what is known after them, and to what it refuses."""

import csv
import json
from dataclasses import replace
from math import pi
from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import run
from millfrf.core import TIP
from millfrf.cutting import MillingProcess, read_cutting_process, write_cutting_process
from millfrf.stability import (
    ChatterVerdict,
    CutSpectrum,
    JudgedCut,
    KeptCut,
    lowest_limits,
    multipliers,
    write_cuts,
)
from modal_fit import ModalModel, read_modal_model, write_modal_model

BAD_INPUT = 2
POLE = 2 * pi * 60 * (-0.03 + 1j)
MODEL = ModalModel(
    np.array([POLE]), np.array([[1 / (2j * 8.0 * POLE.imag), 0, 0]]), np.eye(1, 3) + 0j, TIP, TIP,
    covariance=np.diag([(0.1 * POLE.real) ** 2, (0.03 * POLE.imag) ** 2, *np.zeros(12)]), band=(10.0, 400.0),
    unmeasured_flexibility=1e-12,
)  # fmt: skip
CUT = MillingProcess(4, 0.02, pi / 2, 6e8, 0.3, 0.0, 0.0, pi, 1e-4, ktc_std=1.2e8)
TRUE = (replace(MODEL, poles=MODEL.poles * 1.02, covariance=None), replace(CUT, ktc=4.8e8, ktc_std=0.0))
RPM = 1000.0
LIMIT = float(lowest_limits(*TRUE, np.array([RPM * pi / 30]), 0.1).lowest().depth_limits[0])
SHARES = {0.7: "stable", 0.95: "stable", 1.1: "hopf", 1.3: "hopf"}


def chatter_of(share: float) -> float:
    """Chatter frequency (Hz) of the true cut, the line of the largest multiplier between 60 and 100 Hz."""
    value = multipliers(*TRUE, RPM * pi / 30, share * LIMIT).values[0]
    passing = 4 * RPM / 60
    return float((1 + abs(np.angle(value)) / (2 * pi)) * passing if abs(value) > 1 else np.nan)


def write_table(path: Path, odd: bool = False) -> None:
    """The cuts as a table that a person would type."""
    rows = [(RPM, share * LIMIT, kind, chatter_of(share) if kind == "hopf" else "") for share, kind in SHARES.items()]
    rows += [(RPM, 4 * LIMIT, "stable", "")] if odd else []
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([("spindle_speed_rpm", "depth_m", "verdict", "chatter_frequency_hz"), *rows])


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files of the page."""
    monkeypatch.chdir(tmp_path)
    write_modal_model("tip.json", MODEL)
    write_cutting_process("cut.toml", CUT)
    write_table(Path("cuts.csv"))
    return tmp_path


TYPED = ["--cutting", "cut.toml", "--speeds", "700", "1300", "5", "--max-depth", "0.01"]


def test_cuts_of_a_table_narrow_the_limits(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["learn", "tip.json", "cuts.csv", *TYPED, "--out", "learned"]) == 0
    stated = json.loads(Path("learned/learned.json").read_text(encoding="utf-8"))
    assert stated["verdict"] == "learned"
    assert stated["effective_draws"] > 78
    with Path("learned/limits.csv").open(encoding="utf-8") as file:
        (at,) = [row for row in csv.DictReader(file) if float(row["spindle_speed_rpm"]) == RPM]
    values = {key: float(value) for key, value in at.items()}
    assert values["after_low_m"] < LIMIT < values["after_high_m"]
    width = [values[f"{when}_high_m"] - values[f"{when}_low_m"] for when in ("before", "after")]
    assert width[1] < 0.6 * width[0]
    advice = stated["advice"]
    assert multipliers(*TRUE, advice["spindle_speed_rpm"] * pi / 30, advice["depth_m"]).stable
    learned, cut = read_modal_model("learned/model.json"), read_cutting_process("learned/cut.toml")
    assert learned.covariance is not None
    assert abs(learned.natural_frequencies[0] / 60 - 1.02) < 0.015
    assert 0 < cut.ktc_std < 1.2e8
    assert "97.5 % confidence" in capsys.readouterr().out
    assert (
        run(["lobes", "learned/model.json", "--cutting", "learned/cut.toml", *TYPED[2:5], "2", "--out", "l.csv"]) == 0
    )


def test_a_contradiction_writes_no_model(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_table(Path("cuts.csv"), odd=True)
    assert run(["learn", "tip.json", "cuts.csv", *TYPED, "--out", "learned"]) == 0
    said = capsys.readouterr()
    assert "cuts.csv row 5" in said.err
    assert "another tool" in said.err
    assert "no advice" in said.out
    assert not Path("learned/model.json").exists()
    assert not Path("learned/cut.toml").exists()
    stated = json.loads(Path("learned/learned.json").read_text(encoding="utf-8"))
    assert stated["verdict"] == "contradiction"
    assert stated["advice"] is None
    assert all(row["after_limit_m"] is None for row in stated["limits"])
    Path("learned/model.json").write_text("{}", encoding="utf-8")
    assert run(["learn", "tip.json", "cuts.csv", *TYPED, "--out", "learned", "--force"]) == BAD_INPUT
    assert "earlier run" in capsys.readouterr().err


def write_verdicts(path: Path) -> None:
    """Verdicts as chatter writes them."""
    lines = np.arange(1.0, 200.0, 0.5)
    spectrum = CutSpectrum(0, lines, 0 * lines + 1.0, 0 * lines + 0.1, np.array([16.7]), np.array([1.0]))
    verdicts = (
        ChatterVerdict("stable", 0.01, 1.0, np.nan, spindle_speed=RPM * pi / 30),
        ChatterVerdict("hopf", 0.5, 1.0, chatter_of(1.3), spindle_speed=RPM * pi / 30),
        ChatterVerdict("inconclusive", 0.5, 1.0, np.nan, reason="noise"),
    )
    cuts = [KeptCut(JudgedCut(f"rec{k}.h5", RPM, each), "ax", "m/s^2", spectrum) for k, each in enumerate(verdicts, 1)]
    write_cuts(path, cuts, {})


def test_verdicts_of_chatter_take_their_depths(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_verdicts(Path("chatter.json"))
    depths = ",".join(f"{share * LIMIT:.6f}" for share in (0.9, 1.3, 1.0))
    assert run(["learn", "tip.json", "chatter.json", "--depths", depths, *TYPED, "--out", "learned"]) == 0
    stated = json.loads(Path("learned/learned.json").read_text(encoding="utf-8"))
    assert [cut["verdict"] for cut in stated["cuts"]] == ["stable", "hopf", "inconclusive"]
    assert stated["cuts"][2]["expected"] is None
    assert "2 conclusive cuts of 3" in capsys.readouterr().out
    assert run(["learn", "tip.json", "chatter.json", "--depths", "0.001", *TYPED, "--out", "again"]) == BAD_INPUT
    assert "--depths" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("spindle_speed_rpm,depth_m\n800,0.001\n", "no column verdict"),
        ("spindle_speed_rpm,depth_m,verdict,width\n800,0.001,stable,1\n", "'width'"),
        ("spindle_speed_rpm,depth_m,verdict\n800,1 mm,stable\n", "'1 mm'"),
        ("spindle_speed_rpm,depth_m,verdict\n800,0.001,loud\n", "'loud'"),
        ("spindle_speed_rpm,depth_m,verdict\n,0.001,stable\n", "spindle speed nan"),
        ("spindle_speed_rpm,depth_m,verdict,start_angle_deg\n800,0.001,stable,0\n", "exit_angle_deg"),
        ("spindle_speed_rpm,depth_m,verdict\n800,2,stable\n", "is it in mm"),
    ],
)
def test_a_table_that_is_none_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], text: str, expected: str
) -> None:
    Path("cuts.csv").write_text(text, encoding="utf-8")
    assert run(["learn", "tip.json", "cuts.csv", *TYPED, "--out", "learned"]) == BAD_INPUT
    assert expected in capsys.readouterr().err
    assert not Path("learned").exists()


def test_a_prior_without_errors_is_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_modal_model("bare.json", replace(MODEL, covariance=None))
    write_cutting_process("bare.toml", replace(CUT, ktc_std=0.0))
    assert run(["learn", "bare.json", "cuts.csv", "--cutting", "bare.toml", "--out", "learned"]) == BAD_INPUT
    assert "nothing can be learned" in capsys.readouterr().err
