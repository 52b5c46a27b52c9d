"""`millfrf robot identify`: tables made by a robot of the test's own, its numbers found again, and what is refused."""

import csv
import re
from collections.abc import Callable
from math import cos, radians, sin
from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import BAD_INPUT, DONE, FAILED, run
from millfrf.robot_model import assumptions, in_posture, modes_at, read_deflections, read_robot, read_spatial_robot

FOLDER = Path(__file__).resolve().parents[3] / "millfrf" / "robot_model" / "robots"
TRUE = np.array([0.7e7, 2.0e7, 0.9e7, 1.5e6, 0.8e6, 0.75e6])
"""Stiffness of each joint, N m/rad; the file has 1.03e7, 1.5e7, 1.1e7, 1.2e6, 1.0e6, 0.6e6."""

KUKA = [  # alpha, d, theta, r: modified Denavit-Hartenberg, mm and degrees, as the catalogue has them
    (0, 0, 0, 675),
    (-90, 350, -90, 0),
    (0, 1350, 90, 0),
    (90, -41, 0, 1400),
    (-90, 0, 0, 0),
    (90, 0, 0, 215 + 350),
]


def tool_at(degrees: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Attitude and place (m) of the KUKA's tool, from the catalogue's lengths: no code of the program."""
    whole = np.eye(4)
    for (alpha, d, theta, r), angle in zip(KUKA, degrees, strict=True):
        ca, sa = cos(radians(alpha)), sin(radians(alpha))
        ct, st = cos(radians(theta + angle)), sin(radians(theta + angle))
        whole = whole @ np.array(
            [
                [ct, -st, 0, 1e-3 * d],
                [ca * st, ca * ct, -sa, -1e-3 * r * sa],
                [sa * st, sa * ct, ca, 1e-3 * r * ca],
                [0, 0, 0, 1],
            ]
        )
    return whole[:3, :3], whole[:3, 3]


def pushed(degrees: np.ndarray, force: np.ndarray, pull: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Motion of the target, m: virtual work by differences gives each joint's torque, springs turn, tool is placed."""

    def place(angles: np.ndarray, offset: np.ndarray) -> np.ndarray:
        attitude, origin = tool_at(angles)
        return np.asarray(origin + attitude @ offset)

    turned = []
    for joint in range(6):
        step = 1e-3 * np.eye(6)[joint]
        torque = force @ (place(degrees + step, pull) - place(degrees - step, pull)) / np.radians(2e-3)
        turned.append(np.degrees(torque / TRUE[joint]))
    return place(degrees + np.array(turned), target) - place(degrees, target)


def write_table(
    path: Path, count: int, noise: float, change: Callable[[dict[str, float]], None] = lambda row: None
) -> Path:
    rng = np.random.default_rng(3)
    rows = []
    for _ in range(count):
        degrees = rng.uniform([-60, -60, 60, -90, 30, -90], [60, -10, 120, 90, 110, 90]).round(3)
        force = rng.normal(size=3) * 300 + [0, 0, -600]
        pull, target = np.array([0.1, 0.15, -0.05]), np.array([-0.05, 0.1, 0.1])
        moved = pushed(degrees, force, pull, target) + noise * rng.normal(size=3)
        row = {f"joint_{i + 1}_deg": float(value) for i, value in enumerate(degrees)}
        row |= dict(zip(("fx_n", "fy_n", "fz_n"), force.tolist(), strict=True))
        row |= dict(zip(("dx_m", "dy_m", "dz_m"), moved.tolist(), strict=True))
        row |= {f"pull_{axis}_m": value for axis, value in zip("xyz", pull, strict=True)}
        row |= {f"target_{axis}_m": value for axis, value in zip("xyz", target, strict=True)}
        change(row)
        rows.append(row)
    with path.open("w", newline="") as stream:
        stream.write("# measured with a tracker\n")
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return path


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    """The KUKA with rigid links: its file without tubes, and with a remark of the user's."""
    text = (FOLDER / "kuka_kr90_r3100.toml").read_text(encoding="utf-8")
    text = re.sub(r"\[links\.tube\]\n(?:.+\n)+", "", text)
    path = tmp_path / "rigid.toml"
    path.write_text("# my robot\n" + text, encoding="utf-8")
    return path


def test_stiffnesses_are_found_and_written_into_the_users_file(
    robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, out = write_table(tmp_path / "d.csv", 40, 10e-6), tmp_path / "found.toml"
    assert run(["robot", "identify", str(robot), str(table), "--out", str(out), "--error", "10"]) == DONE
    printed = " ".join(capsys.readouterr().out.split())
    assert "6 of 6 numbers are fixed by the data" in printed
    assert "8 postures held out" in printed
    case = read_spatial_robot(out)
    result = np.array([joint.stiffness[5] for joint in case.robot.joints])
    errors = np.array([float(re.search(r"turning \+-([\d.e+-]+) %", joint)[1]) for joint in _sources(out)])  # type: ignore[index]
    assert np.abs((result / TRUE - 1) / (errors / 100)).max() < 3.0
    assert errors[:5].max() < 4.0  # the last joint has the shortest levers: 16 %
    text = out.read_text(encoding="utf-8")
    assert text.startswith("# provenance: ")
    assert "# my robot" in text
    assert not any(line.startswith("joints") for line in assumptions(out))
    assert any(line.startswith("bodies") for line in assumptions(out))


def test_what_is_open_goes_on_into_modes(robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Errors of natural frequencies from the written file against draws of stiffnesses from its covariance."""
    table, out = write_table(tmp_path / "d.csv", 40, 10e-6), tmp_path / "found.toml"
    assert run(["robot", "identify", str(robot), str(table), "--out", str(out), "--error", "10"]) == DONE
    case = read_spatial_robot(out)
    assert case.uncertainty is not None
    errors = in_posture(case, case.poses["ready"]).known_model().standard_errors()
    assert errors is not None
    rng, nominal = np.random.default_rng(2), np.array([joint.stiffness for joint in case.robot.joints])
    drawn = []
    for logarithms in rng.multivariate_normal(np.zeros(6), case.uncertainty.covariance, size=400):
        stiffness = nominal.copy()
        stiffness[:, 5] *= np.exp(logarithms)
        drawn.append(modes_at(case.robot.with_stiffness(stiffness), case.poses["ready"]).frequencies[:3])
    assert errors[0][:3] == pytest.approx(np.std(drawn, axis=0), rel=0.12)
    again = tmp_path / "again.toml"
    assert run(["robot", "identify", str(out), str(table), "--out", str(again), "--error", "10"]) == FAILED
    assert "nothing is written; the file's hold already" in " ".join(capsys.readouterr().err.split())
    stale = out.read_text(encoding="utf-8").replace("turning_nm_per_rad = 7", "turning_nm_per_rad = 9", 1)
    stale = stale.replace('kind = "stiffness"', 'kind = "damping"', 1)
    out.write_text(stale, encoding="utf-8")
    assert run(["robot", "identify", str(out), str(table), "--out", str(again), "--error", "10"]) == DONE
    assert "the uncertainty of joint 1 turning is lost" in " ".join(capsys.readouterr().err.split())
    assert again.read_text(encoding="utf-8").count("[update]") == 1


@pytest.mark.long
def test_error_bars_cover(robot: Path, tmp_path: Path) -> None:
    """Twelve tables of six numbers: 95 % intervals hold most of the 72 truths (57 or more with 99.9 % chance)."""
    from millfrf.robot_model import identify_elastic, joint_parameters

    case = read_spatial_robot(robot)
    clean = read_deflections(write_table(tmp_path / "d.csv", 25, 0.0), case.robot.mechanism)
    rng, pulls = np.random.default_rng(8), []
    from dataclasses import replace

    for _ in range(12):
        noisy = [replace(each, displacement=each.displacement + 20e-6 * rng.normal(size=3)) for each in clean]
        result = identify_elastic(case.robot, noisy, 20e-6, joint_parameters(case.robot))
        pulls.append(np.log(result.values / TRUE) / result.relative_errors)
    inside = np.abs(np.array(pulls)) < 1.96
    assert 0.87 < inside.mean() <= 1.0
    assert np.std(pulls) == pytest.approx(1.0, abs=0.25)


def test_one_kind_of_posture_tells_less_and_says_so(
    robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Joint 1 alone moves, and all loads are vertical: its own spring gets no torque."""

    def same(row: dict[str, float]) -> None:
        turned = row["joint_1_deg"]
        degrees = np.array([turned, -30.0, 90.0, 0.0, 60.0, 0.0])
        row.update({f"joint_{i + 1}_deg": value for i, value in enumerate(degrees)})
        row.update(fx_n=0.0, fy_n=0.0)
        row.update({f"pull_{axis}_m": 0.0 for axis in "xyz"})
        moved = pushed(degrees, np.array([0, 0, row["fz_n"]]), np.zeros(3), np.array([-0.05, 0.1, 0.1]))
        row.update(dict(zip(("dx_m", "dy_m", "dz_m"), moved, strict=True)))

    table, out = write_table(tmp_path / "d.csv", 30, 0.0, same), tmp_path / "found.toml"
    assert run(["robot", "identify", str(robot), str(table), "--out", str(out), "--error", "10"]) == DONE
    printed = " ".join(capsys.readouterr().out.split())
    assert "not distinguished: ln joint 1 turning" in printed
    assert "not fixed by d.csv: turning (before: " in _sources(out)[0]
    fixed = int(re.search(r"(\d) of 6 numbers are fixed", printed)[1])  # type: ignore[index]
    assert fixed < 6


def test_a_tracker_turned_against_the_base_is_not_believed(
    robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Displacements with two axes exchanged: nothing is written."""

    def exchanged(row: dict[str, float]) -> None:
        row["dx_m"], row["dy_m"] = row["dy_m"], -row["dx_m"]

    table, out = write_table(tmp_path / "d.csv", 40, 10e-6, exchanged), tmp_path / "found.toml"
    code = run(["robot", "identify", str(robot), str(table), "--out", str(out), "--error", "10"])
    captured = " ".join(capsys.readouterr().err.split())
    assert code == FAILED
    assert "nothing is written" in captured
    assert "times their stated error" in captured
    assert not out.exists()


def test_few_postures_are_said_to_prove_nothing(
    robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, out = write_table(tmp_path / "d.csv", 6, 10e-6), tmp_path / "found.toml"
    assert run(["robot", "identify", str(robot), str(table), "--out", str(out), "--error", "10"]) == DONE
    assert "none is held out" in " ".join(capsys.readouterr().out.split())


def _spoiled(name: str, value: object) -> Callable[[dict[str, float]], None]:
    return lambda row: row.update({name: value})  # type: ignore[dict-item]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (_spoiled("dz_m", 0.8), "dz_m = 0.8 is larger than 0.05; give metres; 1 mm is 0.001"),
        (_spoiled("fz_n", "heavy"), "fz_n = 'heavy' is no number"),
        (_spoiled("fz_n", float("nan")), "is not finite"),
        (_spoiled("joint_2_deg", 4000.0), "row 1: joint 2 = 4000"),
        (_spoiled("weight_kg", 3.0), "column 'weight_kg' is not known"),
        (lambda row: row.pop("dx_m"), "lacks the columns dx_m"),
        (lambda row: row.update(fx_n=0.0, fy_n=0.0, fz_n=0.0), "row 1 has no load"),
    ],
)
def test_bad_tables_are_one_line(
    change: Callable[[dict[str, float]], None],
    message: str,
    robot: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    table, out = write_table(tmp_path / "d.csv", 2, 0.0, change), tmp_path / "found.toml"
    assert run(["robot", "identify", str(robot), str(table), "--out", str(out), "--error", "10"]) == BAD_INPUT
    printed = " ".join(capsys.readouterr().err.split())
    assert message in printed
    assert not out.exists()


def test_bad_options_are_one_line(robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table, out = write_table(tmp_path / "d.csv", 2, 0.0), str(tmp_path / "f.toml")
    for arguments, message in (
        (["chen_2026", str(table), "--out", out, "--error", "10"], "planar"),
        ([str(robot), str(table), "--out", out, "--error", "0"], "--error 0 um: give a number above 0 um"),
        ([str(robot), str(table), "--out", out, "--error", "10", "--prior", "1"], "--prior 1: give a number above 1"),
        ([str(robot), str(tmp_path / "none.csv"), "--out", out, "--error", "10"], "no file"),
        ([str(robot), str(table), "--out", str(robot), "--error", "10"], "is the input itself"),
    ):
        assert run(["robot", "identify", *arguments]) == BAD_INPUT
        assert message in " ".join(capsys.readouterr().err.split())


def _sources(path: Path) -> list[str]:
    """What each joint's table says of its numbers."""
    import tomllib

    assert read_robot(path)
    return [joint["source"] for joint in tomllib.loads(path.read_text(encoding="utf-8"))["joints"]]
