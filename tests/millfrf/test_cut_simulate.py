"""Commands that simulate a cut and compute the error of its wall, with and without a workpiece that moves."""

import csv
import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.io import wavfile

import millfrf
from acquisition import opened
from estimation import write_frf
from millfrf.command_line import run
from modal_fit import ModalModel, write_modal_model

CUT = """[cutting]
teeth = 3
diameter_m = 0.0127
immersion = "down"
radial_depth_m = 0.003
feed_per_tooth_m = 1e-4
ktc_pa = 6e8
krc = 0.33
kac = 0.1
"""


def structure(frequency: float) -> ModalModel:
    """A mode along X, and one along Y a fifth higher."""
    natural, stiffness = 2 * np.pi * frequency * np.array([1.0, 1.2]), np.array([2e6, 3e6])
    damped, shapes, points = natural * math.sqrt(1 - 0.02**2), np.eye(2, dtype=complex), ("TCP:+X", "TCP:+Y")
    mass = stiffness / natural**2
    poles = -0.02 * natural + 1j * damped
    return ModalModel(poles, shapes / (2j * mass * damped)[:, None], shapes, points, points, band=(50.0, 4000.0))


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    write_modal_model("tip.json", structure(800.0))
    write_modal_model("wall.json", structure(1100.0))
    Path("cut.toml").write_text(CUT, encoding="utf-8")
    return tmp_path


def test_a_stable_and_a_chattering_cut_are_recorded_and_judged(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    limit = millfrf.lobes("tip.json", "cut.toml", speeds=(9700, 9800, 2), max_depth=0.01).depth_limits[0]
    assert math.isfinite(limit)
    for share, word, name, verdict in (
        (0.7, "stable:", "stable.h5", "stable"),
        (1.15, "not stable:", "chatter.h5", "hopf"),
    ):
        words = ["cut", "simulate", "tip.json", "--cutting", "cut.toml", "--speed", "9700", "--out", name]
        assert run([*words, "--depth", f"{share * limit:.6g}", "--sound", f"{name}.wav", "--revolutions", "200"]) == 0
        assert capsys.readouterr().out.startswith(word)
        judged = millfrf.chatter(name, cutting="cut.toml")
        assert [cut.verdict.kind for cut in judged] == [verdict]
        rate, wave = wavfile.read(f"{name}.wav")
        assert rate == 44_100
        assert 0.75 * 32767 < np.abs(wave.astype(float)).max() < 0.85 * 32767
    with opened("stable.h5") as recording:
        channels = [(channel.name, channel.quantity) for channel in recording.stream().channels]
    assert channels[0] == ("Fx", "force")
    assert channels[4] == ("Dy", "displacement")


def test_the_wall_is_written_with_its_stability_and_what_was_not_measured(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["cut", "wall", "tip.json", "--cutting", "cut.toml", "--speeds", "9000", "18000", "10", "--depth", "1.5e-3"]
    assert run([*words, "--out", "wall.csv", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["wall"] == "down"
    with Path("wall.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(line for line in file if not line.startswith("#")))
    assert len(rows) == len(answer["speeds"]) == 10
    limits = millfrf.lobes("tip.json", "cut.toml", speeds=(9000, 18000, 10), max_depth=0.01).depth_limits
    assert [row["stable"] == "yes" for row in rows] == (limits > 1.5e-3).tolist()
    assert 0 < sum(limits > 1.5e-3) < 10


def test_a_band_without_the_teeth_gives_no_error_of_the_wall(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_modal_model("narrow.json", replace(structure(800.0), band=(700.0, 1100.0)))
    words = ["cut", "wall", "narrow.json", "--cutting", "cut.toml", "--speeds", "3000", "3100", "2", "--depth", "1e-4"]
    assert run([*words, "--out", "wall.csv"]) == 0
    shown = capsys.readouterr()
    assert "the error of the wall is not known" in shown.out
    assert "measure a wider band" in shown.err


def test_a_workpiece_that_moves_lowers_limits_and_moves_the_wall(folder: Path) -> None:
    speeds = (9000, 12000, 4)
    rigid, moving = (
        millfrf.lobes("tip.json", "cut.toml", speeds=speeds, max_depth=0.01, workpiece=workpiece).depth_limits
        for workpiece in (None, "wall.json")
    )
    assert moving.min() < 0.9 * rigid.min()
    walls = [
        millfrf.cut_wall("tip.json", "cut.toml", speeds=(100, 110, 2), depth=1e-4, workpiece=workpiece).error
        for workpiece in (None, "tip.json")
    ]
    assert walls[1] == pytest.approx(2 * walls[0])  # of a workpiece as flexible as the tool
    runs = [
        millfrf.cut_simulate(
            "tip.json", "cut.toml", speed=12000, depth=1e-4, revolutions=60, workpiece=workpiece
        ).motion
        for workpiece in (None, "wall.json")
    ]
    assert np.ptp(runs[1][-600:]) > 1.05 * np.ptp(runs[0][-600:])


def test_the_report_takes_tool_and_workpiece_together(folder: Path) -> None:
    words = ["lobes", "tip.json", "--workpiece", "wall.json", "--cutting", "cut.toml", "--out", "lobes.csv"]
    assert run([*words, "--speeds", "9000", "15000", "13", "--max-depth", "0.01"]) == 0
    assert run(["report", "tip.json", "wall.json", "lobes.csv", "cut.toml", "--out", "report.html"]) == 0
    text = Path("report.html").read_text(encoding="utf-8")
    assert "lobes.csv: time-periodic, of tip.json with wall.json" in text
    assert "is not the stability limit" not in text


def test_limits_at_a_varied_speed_are_written_and_not_compared_by_the_report(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["lobes", "tip.json", "--cutting", "cut.toml", "--speeds", "3000", "3600", "3", "--max-depth", "0.02"]
    assert run([*words, "--variation", "0.2", "0.5", "--out", "varied.csv"]) == 0
    assert "3 not verified" in capsys.readouterr().out
    assert run(["report", "tip.json", "varied.csv", "cut.toml", "--out", "report.html"]) == 0
    text = Path("report.html").read_text(encoding="utf-8")
    assert "varied.csv: its limits hold at a varied spindle speed and are not compared" in text
    assert "varied, varied speed: the lowest depth limit is" in text
    assert "nan Hz" not in text
    limit = millfrf.lobes("tip.json", "cut.toml", speeds=(3000, 3000, 1), max_depth=0.02, variation=(0.2, 0.5))
    depth = f"{0.8 * limit.depth_limits[0]:.6g}"
    cut = ["cut", "simulate", "tip.json", "--cutting", "cut.toml", "--speed", "3000", "--variation", "0.2", "0.5"]
    assert run([*cut, "--depth", depth, "--out", "simulated.h5"]) == 0
    assert "\nstable: the motion repeats" in capsys.readouterr().out
    assert run([*words, "--variation", "0.2", "0.5", "--method", "collocation", "--out", "other.csv"]) == 2
    assert (
        "limits at a varied speed are not computed from --method collocation; leave it out" in capsys.readouterr().err
    )


def test_the_report_recommends_a_cut_of_a_helical_cutter(folder: Path) -> None:
    """End mills are helical; before, reports had neither band nor recommended cut for them."""
    tip = structure(800.0)
    size = 2 * (tip.poles.size + tip.right.size + tip.left.size)
    errors = np.full(size, 1e-9)
    errors[: 2 * tip.poles.size] = 2e-3 * np.abs(tip.poles).max()
    write_modal_model("known.json", replace(tip, covariance=np.diag(errors**2)))
    Path("helix.toml").write_text(CUT + "helix_angle_deg = 35\nktc_std_pa = 2e7\n", encoding="utf-8")
    words = ["lobes", "known.json", "--cutting", "helix.toml", "--speeds", "9000", "15000", "13"]
    assert run([*words, "--max-depth", "0.01", "--out", "lobes.csv"]) == 0
    assert run(["report", "known.json", "lobes.csv", "helix.toml", "--out", "report.html"]) == 0
    text = Path("report.html").read_text(encoding="utf-8")
    assert "largest removal rate at 97.5 % confidence of stability" in text
    assert "Simulation of this cut: the motion repeats to" in text


def test_a_workpiece_needs_a_model_of_the_tool(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_frf("tip.h5", structure(800.0).frf(np.arange(1.0, 2000.0)))
    words = ["lobes", "tip.h5", "--workpiece", "wall.json", "--cutting", "cut.toml", "--out", "lobes.csv"]
    assert run(words) == 2
    assert "fit the FRF first" in capsys.readouterr().err
    assert not Path("lobes.csv").exists()


def test_a_wall_needs_the_receptance_across_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    both = structure(800.0)
    along = replace(
        both, right=both.right[:, :1], left=both.left[:, :1], responses=("TCP:+X",), excitations=("TCP:+X",)
    )
    write_modal_model("x.json", along)
    words = ["cut", "wall", "x.json", "--cutting", "cut.toml", "--speeds", "3000", "3100", "2", "--depth", "1e-4"]
    assert run([*words, "--out", "wall.csv"]) == 2
    assert "tap the tool in Y" in capsys.readouterr().err


def test_period_doubling_that_repeats_every_turn_is_not_called_stable_in_silence(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Two teeth with a little runout, above a limit of period doubling: the motion repeats every turn."""
    text = CUT.replace("teeth = 3", "teeth = 2").replace("0.003", "0.0005") + "runout_m = 1e-6\n"
    Path("flip.toml").write_text(text, encoding="utf-8")
    lobes = millfrf.lobes("tip.json", "flip.toml", speeds=(14000, 28000, 57), max_depth=0.02)
    flips = np.flatnonzero((np.array(lobes.bifurcations) == "period-doubling") & np.isfinite(lobes.depth_limits))
    place = flips[np.argmin(lobes.depth_limits[flips])]
    speed, depth = lobes.spindle_speeds_rpm[place], 1.3 * lobes.depth_limits[place]
    words = ["cut", "simulate", "tip.json", "--cutting", "flip.toml", "--speed", f"{speed:.6g}", "--out", "f.h5"]
    assert run([*words, "--depth", f"{depth:.6g}", "--revolutions", "400"]) == 0
    assert capsys.readouterr().out.startswith(
        ("undecided: the simulated motion repeats, but its Floquet", "not stable")
    )


def test_a_cut_that_has_not_settled_is_not_called_unstable(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The remedy works as it is typed."""
    words = ["cut", "simulate", "tip.json", "--cutting", "cut.toml", "--speed", "3000", "--depth", "1e-4"]
    assert run([*words, "--revolutions", "2", "--out", "short.h5"]) == 0
    said = capsys.readouterr().out
    assert said.startswith("undecided: ")
    [turns] = re.findall(r"give --revolutions (\d+) or more", said)
    assert run([*words, "--revolutions", turns, "--out", "long.h5"]) == 0
    assert capsys.readouterr().out.startswith("stable: ")
