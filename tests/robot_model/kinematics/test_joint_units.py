"""Degrees of revolute joints, metres of prismatic ones: in files, on the command line, in what is printed."""

from pathlib import Path

import numpy as np
import pytest

from millfrf.command_line import BAD_INPUT, DONE, run
from millfrf.core import FileFormatError, InputError
from millfrf.robot_model import Frame, Mechanism, in_posture, modes_at, read_spatial_robot, structure_at, tip_compliance
from millfrf.robot_model.finite_elements.statics import gravity_hessian, with_gravity
from millfrf.robot_model.machining.drilling_deviation import joint_deviation

KUKA = Path(__file__).parents[3] / "millfrf" / "robot_model" / "robots" / "kuka_kr90_r3100.toml"
RAIL = """
[[frames]]
name = "rail"
antecedent = "0"
motion = "prismatic"
alpha_deg = 90.0
limits_m = [0.0, 6.0]
source = "test"
[[frames]]
name = "carriage"
antecedent = "rail"
motion = "fixed"
alpha_deg = -90.0
source = "test"
"""
JOINT = """
[[joints]]
frame = "rail"
nodes = [0, 12]
axial_n_per_m = 5e7
source = "test"
[[links]]
nodes = [12, 1]
source = "test"
"""


@pytest.fixture
def rail(tmp_path: Path) -> Path:
    """The KUKA on a rail along the base's -y: seven driven joints."""
    text = KUKA.read_text(encoding="utf-8").replace(
        'antecedent = "0"\nr_m = 0.675', 'antecedent = "carriage"\nr_m = 0.675'
    )
    head, tail = text.split("[[frames]]", 1)
    tail = tail.replace("nodes = [0, 1]", "nodes = [13, 1]", 1).replace("[0.0, -10.0, 100.0, 0.0, 90.0, 0.0]", "POSE")
    carriage = '\n[[points]]\nnode = 13\nframe = "carriage"\nat_m = [0.0, 0.0, 0.0]\nsource = "test"\n'
    joint = JOINT.replace("nodes = [12, 1]", "nodes = [12, 13]")
    path = tmp_path / "rail.toml"
    path.write_text(
        (head + RAIL + "[[frames]]" + tail + joint + carriage).replace(
            "driven_deg = POSE", "driven = [2.0, 0.0, -10.0, 100.0, 0.0, 90.0, 0.0]"
        ),
        encoding="utf-8",
    )
    return path


def test_a_rail_stands_where_it_is_put(rail: Path) -> None:
    case = read_spatial_robot(rail)
    q = case.poses["ready"]
    assert q[0] == 2.0
    assert q[1:] == pytest.approx(np.radians([0.0, -10.0, 100.0, 0.0, 90.0, 0.0]))
    frame = case.robot.mechanism.frames[0]
    assert (frame.lower, frame.upper) == (0.0, 6.0)
    tool = case.robot.mechanism.index("tool")
    at_home = case.robot.mechanism.transforms(np.concatenate([[0.0], q[1:]]))[tool, :3, 3]
    moved = case.robot.mechanism.transforms(q)[tool, :3, 3]
    assert moved - at_home == pytest.approx([0.0, -2.0, 0.0], abs=1e-12)
    assert not any("rail" in line for line in in_posture(case, q).warnings)


def test_the_rail_gives_way_along_itself(rail: Path) -> None:
    """1 / (5e7 N/m) is added along y, and nothing else is changed: the arm is the same."""
    case, plain = read_spatial_robot(rail), read_spatial_robot(KUKA)
    q = case.poses["ready"]
    result = tip_compliance(structure_at(case.robot, q))
    expected = tip_compliance(structure_at(plain.robot, q[1:]))
    expected[1, 1] += 1 / 5e7
    assert result == pytest.approx(expected, rel=1e-6, abs=1e-15)


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ("2000,0,-10,100,0,90,0", "metres"),
        ("nan,0,-10,100,0,90,0", "metres"),
        ("2,0,-10000,100,0,90,0", "degrees"),
        ("2,0,inf,100,0,90,0", "degrees"),
        ("0,-10,100,0,90,0", "rail (m), 1 (deg)"),
    ],
)
def test_values_that_no_joint_has_are_refused(
    rail: Path, joints: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["robot", "modes", str(rail), "--joints", joints]) == BAD_INPUT
    assert message in capsys.readouterr().err


def test_commands_show_and_take_metres(rail: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "modes", str(rail), "--joints", "2.0,0,-10,100,0,90,0", "--modes", "2"]) == DONE
    captured = capsys.readouterr()
    assert "2.000 m, 0.0 deg, -10.0 deg" in " ".join(captured.out.split())
    assert "outside" not in captured.err
    assert run(["robot", "modes", str(rail), "--joints", "7.5,0,-10,100,0,90,0", "--modes", "2"]) == DONE
    assert "joint rail = 7.5 is outside 0 to 6 m" in capsys.readouterr().err
    assert run(["robot", "stiffness", str(rail), "--at", "1.5", "-2", "0.9"]) == DONE


def test_radians_are_suspected(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["robot", "modes", "kuka_kr90_r3100", "--joints", "0,-0.1745,1.745,0,1.571,0", "--modes", "1"]) == DONE
    assert "radians" in capsys.readouterr().err


def test_keys_say_their_unit(rail: Path) -> None:
    text = rail.read_text(encoding="utf-8")
    rail.write_text(text.replace("limits_m = [0.0, 6.0]", "limits_deg = [0.0, 6.0]"), encoding="utf-8")
    with pytest.raises(InputError, match=r"rail.*prismatic.*limits_m"):
        read_spatial_robot(rail)
    rail.write_text(text.replace("limits_deg = [-185.0, 185.0]", "limits_m = [-3.0, 3.0]"), encoding="utf-8")
    with pytest.raises(InputError, match=r"frame 1.*revolute.*limits_deg"):
        read_spatial_robot(rail)
    rail.write_text(text.replace("driven = [2.0", "driven = [2000.0"), encoding="utf-8")
    with pytest.raises(InputError, match=r"ready.*rail = 2000.*metres"):
        read_spatial_robot(rail)
    rail.write_text(text.replace("driven = [2.0, 0.0", "driven = [0.0"), encoding="utf-8")
    with pytest.raises(InputError, match=r"ready.*6 joint values for 7"):
        read_spatial_robot(rail)
    rail.write_text(text.replace("limits_m = [0.0, 6.0]", "limits_m = [0.0, 6000.0]"), encoding="utf-8")
    with pytest.raises((InputError, FileFormatError), match=r"rail.*6000.*metres"):
        read_spatial_robot(rail)


def test_weight_on_a_rail_turns_no_joint_by_the_rail(rail: Path) -> None:
    """Second derivative of ``sum m g z`` by differences; a level rail adds nothing, and the arm's terms stay."""
    case, plain = read_spatial_robot(rail), read_spatial_robot(KUKA)
    q = case.poses["ready"]
    with_rail = with_gravity(case.robot)
    result = gravity_hessian(with_rail, q, structure_at(with_rail, q))
    alone = with_gravity(plain.robot)
    expected = gravity_hessian(alone, q[1:], structure_at(alone, q[1:]))
    assert result[0] == pytest.approx(np.zeros(7), abs=1e-9)
    assert result[1:, 1:] == pytest.approx(expected, abs=1e-9)
    assert modes_at(with_rail, q).frequencies[0] > 1


def test_drilling_on_a_rail_takes_the_drive_of_the_rail(rail: Path) -> None:
    """A push along the rail moves the tool by F / k of the drive more than the arm alone gives way."""
    case, plain = read_spatial_robot(rail), read_spatial_robot(KUKA)
    q, push = case.poses["ready"], np.array([0.0, 100.0, 0.0, 0.0, 0.0, 0.0])
    result = joint_deviation(case.robot, q, push)
    expected = joint_deviation(plain.robot, q[1:], push) - np.array([0.0, 100.0 / 5e7, 0.0])
    assert result == pytest.approx(expected, abs=1e-10)


def test_joints_listed_in_another_order_or_left_out_are_still_their_own() -> None:
    """Each drive's stiffness is that of its frame, not of its row in the file; a joint without a row is rigid."""
    from dataclasses import replace

    case = read_spatial_robot(KUKA)
    q, push = case.poses["ready"], np.array([100.0, 50.0, 300.0, 1.0, 0.0, 2.0])
    turned = replace(case.robot, joints=case.robot.joints[::-1])
    assert joint_deviation(turned, q, push) == pytest.approx(joint_deviation(case.robot, q, push), rel=1e-12)


def test_a_passive_joint_needs_a_loop() -> None:
    with pytest.raises(InputError, match=r"frame 2 is passive.*loop"):
        Mechanism((Frame("1", "0"), Frame("2", "1", active=False)), "2")
