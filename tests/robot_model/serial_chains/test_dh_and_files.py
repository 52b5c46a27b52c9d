"""Denavit-Hartenberg tables in both conventions, what is refused, and the long form of a serial robot's file."""

from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.robot_model import SpatialCase, has_spherical_wrist, modes_at, numbered_robot_text, read_robot

ROWS = [(0.1, 90, 0.4, 0), (0.56, 0, 0, 90), (0.035, 90, 0, 0), (0, -90, 0.515, 0), (0, 90, 0, 0), (0, 0, 0.08, 0)]
UR10E = Path(__file__).parent / "robots" / "ur10e.urdf"


def about_z(angle: float, along: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, along], [0, 0, 0, 1.0]])


def about_x(angle: float, along: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, along], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1.0]])


def table(tmp_path: Path) -> Path:
    path = tmp_path / "dh.csv"
    lines = [f"{1e3 * a},{alpha},{1e3 * d},{theta}" for a, alpha, d, theta in ROWS]
    path.write_text("\n".join(["a_mm,alpha_deg,d_mm,theta_deg", *lines]))
    return path


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_a_table_means_what_its_convention_says(tmp_path: Path, convention: str) -> None:
    out = tmp_path / "r.toml"
    options = ["--dh", convention, "--joint-stiffness", "1e5,1e5,1e5,1e4,1e4,1e4", "--total-mass", "80"]
    assert run(["new", "robot", str(table(tmp_path)), "--out", str(out), *options]) == DONE
    case = read_robot(out)
    assert isinstance(case, SpatialCase)
    rng = np.random.default_rng(3)
    for q in rng.uniform(-2, 2, (5, 6)):
        place = np.eye(4)
        for (a, alpha, d, theta), value in zip(ROWS, q, strict=True):
            turn, twist = about_z(np.radians(theta) + value, d), about_x(np.radians(alpha), a)
            place = place @ (turn @ twist if convention == "standard" else twist @ turn)
        assert case.robot.mechanism.transforms(q)[-1] == pytest.approx(place, abs=1e-12)
    assert has_spherical_wrist(case.robot.mechanism) == (convention == "standard")
    assert sum(body.mass for body in case.robot.bodies) == pytest.approx(80.0)


@pytest.mark.long
def test_a_base_on_the_ceiling_turns_the_robot(tmp_path: Path) -> None:
    out = tmp_path / "r.toml"
    base = ["--base", "1", "2", "3", "--base-turned", "180", "0", "0"]
    assert run(["new", "robot", str(UR10E), "--out", str(out), *base]) == DONE
    hung = read_robot(out)
    assert run(["new", "robot", str(UR10E), "--out", str(out), "--force"]) == DONE
    stood = read_robot(out)
    assert isinstance(hung, SpatialCase)
    assert isinstance(stood, SpatialCase)
    q = np.array([0.3, -1.0, 1.2, 0.4, 0.8, -0.5])
    first, second = (case.robot.mechanism.transforms(q)[-1, :3, 3] for case in (hung, stood))
    assert first == pytest.approx(np.array([1.0, 2.0, 3.0]) + np.diag([1.0, -1.0, -1.0]) @ second, abs=1e-12)


def test_the_long_form_is_the_same_robot(tmp_path: Path) -> None:
    short = read_robot("staubli_rx160")
    path = tmp_path / "long.toml"
    path.write_text(numbered_robot_text("staubli_rx160"))
    long = read_robot(path)
    assert isinstance(short, SpatialCase)
    assert isinstance(long, SpatialCase)
    q = short.poses["ready"]
    assert modes_at(long.robot, q).frequencies == pytest.approx(modes_at(short.robot, q).frequencies, rel=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('ixx="0.0314743125769"', 'ixx="-0.3"', "negative"),
        ('ixx="0.0314743125769"', 'ixx="3.0"', "larger than the other two"),
        ('mass value="7.778"', 'mass value="-7.778"', "positive mass"),
        ('<child link="forearm_link"/>', '<child link="upper_arm_link"/>', "closed loop"),
        ('name="elbow_joint" type="revolute"', 'name="elbow_joint" type="floating"', "floating"),
        ("</robot>", "", "not a URDF"),
    ],
)
def test_what_no_serial_robot_has_is_refused(
    tmp_path: Path, old: str, new: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    text = UR10E.read_text()
    assert old in text
    path, out = tmp_path / "r.urdf", tmp_path / "r.toml"
    path.write_text(text.replace(old, new))
    assert run(["new", "robot", str(path), "--out", str(out)]) == BAD_INPUT
    error = capsys.readouterr().err
    assert said in error
    assert not out.exists()


def test_a_table_without_convention_or_unit_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = table(tmp_path), str(tmp_path / "r.toml")
    assert run(["new", "robot", str(path), "--out", out]) == BAD_INPUT
    assert "--dh standard" in capsys.readouterr().err
    path.write_text(path.read_text().replace("a_mm", "a"))
    assert run(["new", "robot", str(path), "--out", out, "--dh", "standard"]) == BAD_INPUT
    assert "'a' is not known" in capsys.readouterr().err
