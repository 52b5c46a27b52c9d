"""`robot lobes` says what decides, `robot map` and `robot compensate` write tables and pictures."""

import csv
from pathlib import Path

import numpy as np
import pytest
from milling_of_a_path import CUT

from millfrf.command_line import run
from millfrf.core.provenance import read_provenance
from millfrf.robot_model import modal_model_at, named_posture, read_robot
from millfrf.stability import certified_lobes
from millfrf.steps.robot.tip_lobes import settled_modes


@pytest.fixture(autouse=True)
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "cut.toml").write_text(CUT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.long
def test_lobes_say_whether_mode_coupling_decides(inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = "robot lobes kuka_kr90_angled --at 1.6 0.1 0.7 --cutting cut.toml --max-depth 0.02 --out out.csv"
    assert run([*words.split(), "--speeds", "3000", "4000", "2"]) == 0
    shown = capsys.readouterr().out
    assert "coupling of modes lowers the regenerative limit" in shown
    assert "without regeneration the cut grows from" in shown
    assert "coupling" in read_provenance(inputs / "out.csv")["options"]["mode_coupling"]


def test_map_tells_how_every_limit_was_found(inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = "robot map kuka_kr90_angled --cutting cut.toml --speed 3000 --x 1.4 3.4 3 --y 0 0.2 2 --z 0.7 --out map.csv"
    assert run([*words.split(), "--picture", "map.png"]) == 0
    assert "checked by Floquet multipliers" in capsys.readouterr().out
    lines = [line for line in (inputs / "map.csv").read_text(encoding="utf-8").splitlines() if line[0] != "#"]
    rows = list(csv.DictReader(lines))
    assert len(rows) == 6
    assert {row["reached"] for row in rows} == {"yes", "no"}
    for row in rows:
        assert row["status"] == ("verified" if row["reached"] == "yes" else "not reached")
        assert bool(row["depth_limit_m"]) == (row["reached"] == "yes")
    assert read_provenance(inputs / "map.csv")["options"]["speed_rpm"] == 3000
    assert (inputs / "map.png").stat().st_size > 10_000


def test_map_without_a_place_to_go_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "map", "kuka_kr90_angled"]) == 2
    assert "--picture FILE.png, --out FILE.csv" in capsys.readouterr().err


def test_compensate_draws(inputs: Path) -> None:
    rows = ["1.5,0,0.7,3.14159265,0,0,0,100,50", "1.6,0,0.7,3.14159265,0,0,0,100,50"]
    heads = "x_m,y_m,z_m,rx_rad,ry_rad,rz_rad,fx_n,fy_n,fz_n"
    (inputs / "p.csv").write_text("\n".join([heads, *rows]) + "\n", encoding="utf-8")
    words = "robot compensate kuka_kr90_r3100 p.csv --out c.csv --picture c.png"
    assert run(words.split()) == 0
    assert (inputs / "c.png").stat().st_size > 10_000


@pytest.mark.long
def test_fewer_modes_give_the_limits_of_all() -> None:
    from millfrf.cutting import read_cutting_process

    case = read_robot("kuka_kr90_r3100")
    model = modal_model_at(case.robot, named_posture(case, None), highest_frequency=1000.0)  # type: ignore[union-attr]
    process, speeds = read_cutting_process("cut.toml"), np.array([1200.0, 1500.0]) * np.pi / 30
    small, words = settled_modes(model, process, speeds, 0.01)
    assert len(small.poles) < len(model.poles)
    assert "replaced by their static flexibility" in words[0]
    limits = [certified_lobes(each, process, speeds, 0.01).depth_limits for each in (model, small)]
    assert limits[1] == pytest.approx(limits[0], rel=0.01)
