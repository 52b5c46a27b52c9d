"""Motors behind gears: the two-inertia oscillator in closed form, chains by Lagrange, statics, weight, files."""

from dataclasses import replace
from math import pi, sqrt
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh

from millfrf.core import FileFormatError, InputError
from millfrf.robot_model import (
    Frame,
    Mechanism,
    SpatialRobot,
    changed_robot_text,
    drive_stiffness,
    in_posture,
    modes_at,
    read_spatial_robot,
    structure_at,
    tip_compliance,
    tool_jacobian,
)
from millfrf.robot_model.dynamic_stiffness import coupled_frf_at, exact_frf_at
from millfrf.robot_model.finite_elements.statics import gravity_hessian
from millfrf.robot_model.machining.drilling_deviation import joint_deviation
from millfrf.robot_model.posture_process.modal_basis import basis_at, part_names
from millfrf.robot_model.spatial.spatial_modes import frf_at
from millfrf.robot_model.spatial.spatial_robot import ElasticJoint, JointDrive, Link, LumpedBody

KUKA = read_spatial_robot("kuka_kr90_r3100")


def two_inertias(load: float, k: float, drive: JointDrive | None, motion: str = "revolute") -> SpatialRobot:
    """A load (kg m^2 about the joint, or kg) behind a gear of stiffness k."""
    own = 5 if motion == "revolute" else 2
    stiffness = np.full(6, np.inf)
    stiffness[own] = k
    mass, inertia = (1.0, np.diag([load] * 3)) if motion == "revolute" else (load, np.eye(3))
    return SpatialRobot(
        Mechanism((Frame("1", "0", motion=motion),), "1"),
        (ElasticJoint("1", (0, 1), stiffness, drive),),
        (),
        (LumpedBody(1, "1", mass, np.zeros(3), inertia),),
        {},
        1,
    )


def closed_form(rotor: float, load: float, gain: float, k: float) -> list[float]:
    """``w^2 = (a + b -+ sqrt((a - b)^2 + 4 k^2 / (J_r J_l))) / 2``, ``a = (K_p + k) / J_r``, ``b = k / J_l``; Hz."""
    a, b = (gain + k) / rotor, k / load
    root = sqrt((a - b) ** 2 + 4 * k**2 / (rotor * load))
    return [sqrt((a + b + sign * root) / 2) / (2 * pi) for sign in (-1, 1)]


@settings(max_examples=40)
@given(
    st.floats(1e-4, 1e-2),
    st.floats(50, 250),
    st.floats(5.0, 300.0),
    st.floats(1e5, 1e8),
    st.floats(1e5, 1e8),
    st.sampled_from(["revolute", "prismatic"]),
)
def test_two_inertias_are_the_closed_form(
    motor: float, ratio: float, load: float, gain: float, k: float, motion: str
) -> None:
    drive = JointDrive(motor, ratio, gain)
    result = modes_at(two_inertias(load, k, drive, motion), np.zeros(1)).frequencies
    assert result == pytest.approx(closed_form(ratio**2 * motor, load, gain, k), rel=1e-9)


def test_a_motor_held_fast_is_no_motor_and_a_soft_one_is_in_series() -> None:
    load, k = 40.0, 1e6
    alone = modes_at(two_inertias(load, k, None), np.zeros(1)).frequencies
    held = modes_at(two_inertias(load, k, JointDrive(1e-3, 100.0, 1e13)), np.zeros(1)).frequencies
    assert held[0] == pytest.approx(alone[0], rel=1e-6)
    light = two_inertias(load, k, JointDrive(1e-9, 1.0, 3e6))
    series = 1 / (1 / k + 1 / 3e6)
    assert modes_at(light, np.zeros(1)).frequencies[0] == pytest.approx(sqrt(series / load) / (2 * pi), rel=1e-6)
    assert tip_compliance(structure_at(light, np.zeros(1)))[5, 5] == pytest.approx(1 / series)
    assert drive_stiffness(light) == pytest.approx([series])


def test_a_free_motor_gives_the_textbooks_resonance_and_antiresonance() -> None:
    """With hardly any hold: sqrt(k (1/J_r + 1/J_l)) from the motor's side, sqrt(k / J_l) where the load absorbs."""
    rotor, load, k = 60.0, 40.0, 1e6
    result = modes_at(two_inertias(load, k, JointDrive(rotor / 1e4, 100.0, 1e-3)), np.zeros(1))
    assert result.frequencies[1] == pytest.approx(sqrt(k * (1 / rotor + 1 / load)) / (2 * pi), rel=1e-6)
    assert result.frequencies[0] < 1e-3
    rotor_turn = result.shapes[:, 2, 5]  # node 2 is the rotor's
    gain = np.sum(rotor_turn**2 / (result.squares - k / load))
    assert abs(gain) < 1e-9 * np.sum(rotor_turn**2 / np.abs(result.squares - k / load))


def two_links(drives: tuple[JointDrive | None, JointDrive | None]) -> tuple[SpatialRobot, np.ndarray]:
    """Two rigid links in a plane with a point mass at each end; second joint about the same axis."""
    stiffness = np.array([[np.inf] * 5 + [2e6], [np.inf] * 5 + [7e5]])
    robot = SpatialRobot(
        Mechanism((Frame("1", "0"), Frame("2", "1", d=0.9), Frame("tool", "2", motion="fixed", d=0.7)), "tool"),
        tuple(
            ElasticJoint(name, nodes, row, drive)
            for name, nodes, row, drive in zip("12", ((0, 1), (2, 3)), stiffness, drives, strict=True)
        ),
        (Link((1, 2)), Link((3, 4))),
        (
            LumpedBody(2, "1", 60.0, np.zeros(3), np.diag([1.0, 1.0, 3.0])),
            LumpedBody(4, "2", 25.0, np.zeros(3), np.diag([1.0, 1.0, 0.5])),
        ),
        {2: ("1", np.array([0.9, 0.0, 0.0])), 4: ("2", np.array([0.7, 0.0, 0.0]))},
        4,
    )
    return robot, stiffness[:, 5]


@pytest.mark.parametrize("elbow", [0.0, 0.8, 2.5])
def test_two_links_with_drives_are_lagranges(elbow: float) -> None:
    """Four coordinates (q1, q2, m1, m2): ``T = T_links(q') + 1/2 N^2 J m'^2``, springs between q and m (Spong 1987)."""
    drives = (JointDrive(4e-3, 150.0, 8e6), JointDrive(1e-3, 120.0, 2e6))
    robot, k = two_links(drives)
    a, b, heavy, tip, inertias = 0.9, 0.7, 60.0, 25.0, (3.0, 0.5)
    x = np.array([[-b * np.sin(elbow), -b * np.sin(elbow), 0, 0]])
    y = np.array([[a + b * np.cos(elbow), b * np.cos(elbow), 0, 0]])
    first = np.array([[a, 0, 0, 0]])
    mass = heavy * first.T @ first + tip * (x.T @ x + y.T @ y)
    mass += inertias[0] * np.diag([1.0, 0, 0, 0])
    both = np.array([[1.0, 1.0, 0, 0]])
    mass += inertias[1] * both.T @ both
    mass += np.diag([0, 0, *(drive.gear_ratio**2 * drive.motor_inertia for drive in drives)])
    stiffness = np.zeros((4, 4))
    for joint in range(2):
        gear = np.zeros(4)
        gear[[joint, 2 + joint]] = 1, -1
        stiffness += k[joint] * np.outer(gear, gear)
        stiffness[2 + joint, 2 + joint] += drives[joint].position_gain
    expected = np.sqrt(eigh(stiffness, mass, eigvals_only=True)) / (2 * pi)
    q = np.array([0.4, elbow])
    assert modes_at(robot, q).frequencies == pytest.approx(expected, rel=1e-9)
    jacobian = tool_jacobian(robot.mechanism, q)
    series = [1 / (1 / k[j] + 1 / drives[j].position_gain) for j in range(2)]
    linear = (jacobian / series) @ jacobian.T
    assert tip_compliance(structure_at(robot, q)) == pytest.approx(linear, rel=1e-9, abs=1e-15)
    wrench = np.array([30.0, -20.0, 0.0, 0.0, 0.0, 5.0])
    assert joint_deviation(robot, q, wrench) == pytest.approx(-(linear @ wrench)[:3], rel=1e-3, abs=1e-9)


def test_weight_turns_joint_and_motor_together() -> None:
    """The stiffness of weight acts on the whole turn of a joint: an upright load falls where m g l beats the series."""
    robot, _ = two_links((JointDrive(4e-3, 150.0, 8e6), None))
    weighed = replace(robot, gravity=9.81, up=(1.0, 0.0, 0.0))
    q = np.zeros(2)
    structure = structure_at(weighed, q)
    hessian = gravity_hessian(weighed, q, structure)
    with_drive = np.zeros((6 * len(structure.positions), 2))
    for column in range(2):  # both links turn by one about joint 1 or 2, seen from the base
        for node, position in enumerate(structure.positions):
            carried = node in (1, 2, 3, 4) if column == 0 else node in (3, 4)
            if carried:
                arm = position - np.array([0.9 * column, 0, 0])
                with_drive[6 * node : 6 * node + 6, column] = [-arm[1], arm[0], 0, 0, 0, 1]
    assert structure.weight is not None
    assert with_drive.T @ structure.weight @ with_drive == pytest.approx(hessian, rel=1e-12)
    assert in_posture(replace(KUKA, robot=weighed), q).own_weight is not None


def with_drives(ratio: float, gain: float) -> SpatialRobot:
    """The KUKA with a motor of 4e-3 kg m^2 on each joint, held ``gain`` times as stiffly as its gear is."""
    joints = tuple(
        replace(joint, drive=JointDrive(4e-3, ratio, gain * joint.stiffness[5])) for joint in KUKA.robot.joints
    )
    return replace(KUKA.robot, joints=joints)


def test_a_whole_robot_with_drives() -> None:
    """FRF by modes and by exact beams agree; drives add six modes and lower all that were there."""
    q = KUKA.poses["ready"]
    robot = with_drives(150.0, 3.0)
    plain, driven = modes_at(KUKA.robot, q), modes_at(robot, q)
    assert len(driven.squares) == len(plain.squares) + 6
    softer = np.array([joint.stiffness for joint in KUKA.robot.joints])
    softer[:, 5] *= 3 / 4  # gears and holds in series, motors without inertia
    massless = modes_at(KUKA.robot.with_stiffness(softer), q).frequencies
    assert np.all(driven.frequencies[:6] < massless[:6])  # inertia only lowers (Rayleigh)
    assert np.all(massless[:6] < plain.frequencies[:6])
    assert [plain.frequencies[0], massless[0], driven.frequencies[0]] == pytest.approx([16.89, 15.37, 15.34], abs=0.01)
    lines = np.array([5.0, 12.0, 25.0])
    undamped = replace(robot, damping_ratio=1e-9)
    exact = exact_frf_at(undamped, q, lines).values
    assert frf_at(undamped, q, lines).values == pytest.approx(exact, rel=2e-3, abs=1e-10)
    with pytest.raises(InputError, match="motor's inertia"):
        coupled_frf_at(robot, q, lines)


@pytest.mark.parametrize("flexible", [True, False])
def test_parts_of_a_posture_add_up_with_motors(flexible: bool) -> None:
    """What measured postures are learned about divides modal stiffness and mass among parts: motors may not be lost."""
    robot = with_drives(150.0, 3.0)
    if not flexible:
        robot = replace(robot, links=tuple(replace(link, section=None, elements=1) for link in robot.links))
    basis, _ = basis_at(robot, KUKA.poses["ready"])
    names = part_names(robot)
    assert [len(each) for each in names] == [len(basis.stiffness), len(basis.mass)]
    assert names[0][-1] == ("links and motors" if flexible else "motors")
    assert basis.stiffness.sum(axis=0) == pytest.approx(np.diag(basis.squares), abs=1e-9 * basis.squares.max())
    assert basis.mass.sum(axis=0) == pytest.approx(np.eye(len(basis.squares)), abs=1e-9)


def test_drives_come_from_the_file(tmp_path: Path) -> None:
    path = tmp_path / "r.toml"

    def written(**keys: float) -> Path:
        path.write_text(
            changed_robot_text("kuka_kr90_r3100", {("joints", 1, key): value for key, value in keys.items()})
        )
        return path

    drive = {"motor_inertia_kg_m2": 4e-3, "gear_ratio": 180.0, "position_gain_nm_per_rad": 3e7}
    joint = read_spatial_robot(written(**drive)).robot.joints[1]
    assert joint.drive == JointDrive(4e-3, 180.0, 3e7)
    for changed, message in (
        ({"gear_ratio": 180.0}, "joint 2: a drive is motor_inertia_kg_m2, gear_ratio and"),
        ({**drive, "gear_ratio": 0.0055}, "gear_ratio must be 1 or more"),
        ({**drive, "motor_inertia_kg_m2": 40.0}, "motor_inertia_kg_m2 must be 1 or less"),
        ({**drive, "position_gain_n_per_m": 1e6}, "give these three"),
    ):
        with pytest.raises((InputError, FileFormatError), match=message):
            read_spatial_robot(written(**changed))
    passive = changed_robot_text("fanuc_s420if", {("joints", 2, key): value for key, value in drive.items()})
    path.write_text(passive)
    with pytest.raises(InputError, match="joint 3 is not driven"):
        read_spatial_robot(path)
