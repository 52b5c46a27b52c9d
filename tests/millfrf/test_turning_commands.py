"""Turning from a new file to lobes and report, and commands that take milling only."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import run
from modal_fit import ModalModel, write_modal_model

CUT = """[turning]
diameter_m = 0.05
edge_angle_deg = 75
nose_radius_m = {nose}
feed_per_revolution_m = 1e-4
ktc_pa = 1e9
krc = 0.5
kac = 0.2
ktc_std_pa = 4e7
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder with a boring bar of two modes across its axis, and cuts with and without a nose radius."""
    monkeypatch.chdir(tmp_path)
    natural, points = 2 * np.pi * np.array([230.0, 255.0]), ("T:+X", "T:+Y", "T:+Z")
    damped = natural * math.sqrt(1 - 0.03**2)
    shapes = np.array([[0.05, 0.4, 0.9], [0.1, 0.9, -0.4]]) / np.sqrt(2j * damped)[:, None]
    model = ModalModel(-0.03 * natural + 1j * damped, shapes, shapes, points, points)
    write_modal_model("bar.json", model)
    Path("turn.toml").write_text(CUT.format(nose=0), encoding="utf-8")
    Path("nose.toml").write_text(CUT.format(nose=8e-4), encoding="utf-8")
    return tmp_path


def test_from_a_new_file_to_lobes_and_report(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["new", "cut", "--turning", "--diameter", "0.05", "--material", "aluminium", "--out", "new.toml"]) == 0
    assert "[turning]\n" in Path("new.toml").read_text(encoding="utf-8")
    assert run(["lobes", "bar.json", "--cutting", "new.toml", "--out", "new.csv"]) == 0
    capsys.readouterr()
    limits = []
    for name in ("turn", "nose"):
        words = ["bar.json", "--cutting", f"{name}.toml", "--speeds", "1000", "1600", "4", "--max-depth", "0.004"]
        assert run(["lobes", *words, "--out", f"{name}.csv", "--json"]) == 0
        limits.append(json.loads(capsys.readouterr().out)["lowest_depth_limit_m"])
    # a depth below the nose radius is cut by an edge that pushes along Z, where the bar is soft
    assert limits[1] < 0.9 * limits[0]
    assert run(["report", "bar.json", "turn.csv", "turn.toml", "--out", "report.html"]) == 0
    page = Path("report.html").read_text(encoding="utf-8")
    assert "Turning of turn.toml: edge at 75° to the feed" in page


def test_a_slow_lathe_gets_its_picture(folder: Path) -> None:
    """A revolution of 460 waves: no step may collocate it."""
    words = ["lobes", "bar.json", "--cutting", "turn.toml", "--speeds", "30", "60", "3", "--max-depth", "0.004"]
    assert run([*words, "--out", "slow.csv", "--picture", "slow.png"]) == 0
    assert run(["report", "bar.json", "slow.csv", "turn.toml", "--out", "slow.html"]) == 0
    assert Path("slow.png").stat().st_size > 0


def test_milling_options_and_commands_refuse_turning(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["new", "cut", "--turning", "--teeth", "2", "--out", "x.toml"]) == 2
    assert "turning has one edge" in capsys.readouterr().err
    words = ["bar.json", "--cutting", "turn.toml"]
    assert run(["cut", "simulate", *words, "--speed", "1500", "--depth", "1e-4", "--out", "x.h5"]) == 2
    assert "does not take turning" in capsys.readouterr().err
    assert run(["lobes", *words, "--speeds", "1000", "1600", "4", "--variation", "0.1", "20", "--out", "x.csv"]) == 2
    assert "does not take turning" in capsys.readouterr().err
    assert not list(folder.glob("x.*"))
