"""`millfrf robot path`: what it writes, and that what it chooses is better, continuous and certified."""

import csv
from pathlib import Path

import numpy as np
import pytest
from milling_of_a_path import CUT

from millfrf.command_line import run
from millfrf.cutting import force_harmonics, read_cutting_process
from millfrf.robot_model import Payload, read_spatial_robot, tool_deflection, tool_down


@pytest.fixture
def inputs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    rows = [f"{x:.4f},0.1,0.7,0,0,1" for x in np.linspace(1.5, 1.6, 3)]
    (tmp_path / "path.csv").write_text("\n".join(["x_m,y_m,z_m,i,j,k", *rows]) + "\n", encoding="utf-8")
    (tmp_path / "cut.toml").write_text(CUT, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def command(robot: str, *more: str) -> list[str]:
    words = f"robot path {robot} path.csv --cutting cut.toml --speed 6000 --depth 0.002"
    turns = () if "--turns" in more else ("--turns", "-120", "0", "5")
    return [*words.split(), *turns, *more]


def table(path: Path) -> list[dict[str, str]]:
    lines = [line for line in path.read_text(encoding="utf-8").splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


@pytest.mark.long
def test_depth_grows_and_the_folder_holds_all(inputs: Path) -> None:
    assert run(command("kuka_kr90_angled", "--out", "out")) == 0
    rows = table(inputs / "out" / "path.csv")
    depth = np.array([float(row["depth_limit_m"]) for row in rows])
    before = np.array([float(row["before_depth_limit_m"]) for row in rows])
    assert len(rows) == 3
    assert depth.min() > 1.5 * before.min()
    assert {row["status"] for row in rows} == {"verified"}
    joints = np.array([[float(row[f"q{i + 1}"]) for i in range(6)] for row in rows])
    assert np.abs(np.diff(joints, axis=0)).max() <= 15
    assert min(float(row["limit_margin_deg"]) for row in rows) >= 5
    assert all(-120 <= float(row["tool_turn_deg"]) <= 0 for row in rows)
    assert (inputs / "out" / "path.png").stat().st_size > 10_000
    corrected = table(inputs / "out" / "compensated.csv")
    moved = [float(row["x_m"]) - float(given["x_m"]) for row, given in zip(corrected, rows, strict=True)]
    assert np.abs(moved).max() < 2e-3
    assert np.abs(moved).min() > 1e-6


@pytest.mark.long
def test_a_spindle_in_line_with_the_last_joint_gains_nothing_and_stays(inputs: Path) -> None:
    assert run(command("kuka_kr90_r3100", "--out", "table.csv")) == 0
    for row in table(inputs / "table.csv"):
        assert float(row["depth_limit_m"]) == pytest.approx(float(row["before_depth_limit_m"]), rel=1e-6)
        assert float(row["tool_turn_deg"]) == pytest.approx(0, abs=1e-6)


@pytest.mark.long
def test_deviation_and_both_choose_what_they_say(inputs: Path, capsys: pytest.CaptureFixture[str]) -> None:
    few = ("--turns", "-120", "0", "3")
    assert run(command("kuka_kr90_angled", *few, "--optimise", "deviation", "--out", "stiff.csv")) == 0
    assert run(command("kuka_kr90_angled", *few, "--optimise", "depth", "--out", "deep.csv")) == 0
    assert run(command("kuka_kr90_angled", *few, "--optimise", "both", "--out", "both.csv")) == 0
    assert "front:" in capsys.readouterr().out
    worst = {}
    for name in ("stiff", "deep", "both"):
        rows = table(inputs / f"{name}.csv")
        moved = [[float(row[f"deviation_{a}_m"]) for a in ("along", "across", "axial")] for row in rows]
        worst[name] = np.linalg.norm(moved, axis=1).max(), min(float(row["depth_limit_m"]) for row in rows)
    assert worst["stiff"][0] <= 1.001 * min(size for size, _ in worst.values())
    assert worst["deep"][1] >= 0.97 * max(depth for _, depth in worst.values())
    assert worst["stiff"][0] <= 1.001 * worst["both"][0] <= 1.002 * worst["deep"][0]


@pytest.mark.long
def test_a_table_adds_to_the_turn_about_the_tool(inputs: Path) -> None:
    """Its axis runs along this path: tips stay, tool axes turn about x by what the table says, depth doubles."""
    more = ("--turns", "-90", "-60", "2", "--table-turns", "-30", "0", "2")
    assert run(command("kuka_kr90_angled", *more, "--out", "out")) == 0
    rows = table(inputs / "out" / "path.csv")
    turned = np.radians([float(row["table_turn_deg"]) for row in rows])
    assert np.degrees(turned).min() >= -30
    assert np.degrees(turned).max() < -10
    assert np.abs(np.diff(np.degrees(turned))).max() <= 10
    for row, angle, x in zip(rows, turned, np.linspace(1.5, 1.6, 3), strict=True):
        assert [float(row[name]) for name in ("x_m", "y_m", "z_m")] == pytest.approx([x, 0.1, 0.7], abs=1e-9)
        axis = [float(row[name]) for name in "ijk"]
        assert axis == pytest.approx([0, -np.sin(angle), np.cos(angle)], abs=1e-8)
    least = [min(float(row[name]) for row in rows) for name in ("depth_limit_m", "before_depth_limit_m")]
    assert least[0] > 1.8 * least[1]
    corrected = table(inputs / "out" / "compensated.csv")
    moved = [
        [float(each[n]) - float(row[n]) for n in ("x_m", "y_m", "z_m")]
        for each, row in zip(corrected, rows, strict=True)
    ]
    assert 1e-4 < np.linalg.norm(moved, axis=1).max() < 2e-3


@pytest.mark.long
def test_weight_counts_from_the_first_point_where_the_change_is_asked(inputs: Path) -> None:
    """Deviation against the compliance of each posture: cut, and weight without its part at the first point."""
    more = ("--turns", "0", "0", "1", "--weight", "change", "--payload", "20", "--out", "change.csv")
    assert run(command("kuka_kr90_angled", *more)) == 0
    robot, moved, sags, axes = read_spatial_robot("kuka_kr90_angled").robot, [], [], tool_down([1.5, 0.1, 0.7]).axes
    wrench = np.zeros(6)
    wrench[:3] = 0.002 * axes @ force_harmonics(read_cutting_process(inputs / "cut.toml"), 0)[0].real
    rows = table(inputs / "change.csv")
    for row in rows:
        q = np.radians([float(row[f"q{i + 1}"]) for i in range(6)])
        cut, weight = tool_deflection(robot, q, wrench, Payload(20.0))
        moved.append(cut[:3])
        sags.append(weight[:3])
    assert np.linalg.norm(sags[-1] - sags[0]) > 3e-5
    stated = [[float(row[f"deviation_{a}_m"]) for a in ("along", "across", "axial")] for row in rows]
    expected = np.array(moved) + np.array(sags) - sags[0]
    assert stated == pytest.approx(expected @ axes, abs=1e-9)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--optimise", "speed"), 'Invalid value "speed" for --optimise'),
        (("--balance", "2"), "--balance 2: give a share at most 1"),
        (("--table-at", "1", "0", "0"), "--table-turns LO HI N"),
        (("--limit-margin", "120"), "--limit-margin 120 deg: give a number at most 90 deg"),
        (("--limit-margin", "80"), "in no posture that keeps the margins"),
        (("--joint-step", "0.01", "--turns", "-90", "-90", "1"), "no continuous sequence"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(
    inputs: Path, capsys: pytest.CaptureFixture[str], more: tuple[str, ...], words: str
) -> None:
    assert run(command("kuka_kr90_angled", "--out", "out", *more)) == 2
    assert words in capsys.readouterr().err
    assert not (inputs / "out").exists()
