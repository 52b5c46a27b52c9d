"""Joints that share a node: each acts about its own axis, through its own place, checked by hand computations."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from millfrf.core import InputError
from millfrf.robot_model import (
    Frame,
    Mechanism,
    SpatialRobot,
    in_posture,
    modes_at,
    read_spatial_robot,
    structure_at,
    tip_compliance,
)
from millfrf.robot_model.dynamic_stiffness import coupled_frf_at, exact_frf_at
from millfrf.robot_model.finite_elements.structure import coordinate_basis, stiffness_matrix
from millfrf.robot_model.spatial.spatial_robot import ElasticJoint, Link, LumpedBody

QUARTER = np.pi / 2
TURNING = (2e5, 1e5, 5e4)


def turning(value: float) -> np.ndarray:
    return np.array([*[np.inf] * 5, value])


def arm(nodes: tuple[tuple[int, int], ...] = ((0, 1), (1, 2), (2, 3)), tip: int = 4) -> SpatialRobot:
    """Joint 1 about z at the base, joint 2 about y at (0.2, 0, 0.5), joint 3 about z at (0.9, 0, 0.5), tip 0.3 m on.

    The nodes of neighbouring joints are one: node 1 is the body between joints 1 and 2, half a metre long.
    """
    mechanism = Mechanism(
        (
            Frame("1", "0"),
            Frame("2", "1", b=0.5, alpha=-QUARTER, d=0.2),
            Frame("3", "2", alpha=QUARTER, d=0.7),
            Frame("tool", "3", motion="fixed", d=0.3),
        ),
        "tool",
    )
    joints = tuple(ElasticJoint(name, pair, turning(k)) for name, pair, k in zip("123", nodes, TURNING, strict=True))
    bodies = tuple(
        LumpedBody(pair[1], name, 10.0, np.array([0.1, 0.0, 0.05]), np.eye(3))
        for name, pair in zip("123", nodes, strict=True)
    )
    links = (Link((nodes[2][1], tip)),)
    return SpatialRobot(mechanism, joints, links, bodies, {tip: ("tool", np.zeros(3))}, tip, damping_ratio=0.02)


def by_hand(q: np.ndarray) -> np.ndarray:
    """``sum_j (z_j x r_j; z_j) (z_j x r_j; z_j)^T / k_j`` with the geometry written out, shape (6, 6)."""
    c1, s1, c2, s2 = np.cos(q[0]), np.sin(q[0]), np.cos(q[1]), np.sin(q[1])
    turn = np.array([[c1, -s1, 0.0], [s1, c1, 0.0], [0.0, 0.0, 1.0]])
    pitch = np.array([[c2, 0.0, s2], [0.0, 1.0, 0.0], [-s2, 0.0, c2]])
    second = turn @ [0.2, 0.0, 0.5]
    third = second + turn @ pitch @ [0.7, 0.0, 0.0]
    tip = third + turn @ pitch @ [0.3 * np.cos(q[2]), 0.3 * np.sin(q[2]), 0.0]
    axes = (np.array([0.0, 0.0, 1.0]), turn @ [0.0, 1.0, 0.0], turn @ pitch @ [0.0, 0.0, 1.0])
    whole = np.zeros((6, 6))
    for axis, place, k in zip(axes, (np.zeros(3), second, third), TURNING, strict=True):
        column = np.concatenate([np.cross(axis, tip - place), axis])
        whole += np.outer(column, column) / k
    return whole


@pytest.mark.parametrize("q", [(0.0, 0.0, 0.0), (0.4, -0.7, 1.1), (-1.2, 0.5, 2.0)])
def test_joints_at_a_shared_node_turn_about_their_own_places(q: tuple[float, ...]) -> None:
    result = tip_compliance(structure_at(arm(), np.array(q)))
    assert result == pytest.approx(by_hand(np.array(q)), rel=1e-9, abs=1e-9 * np.abs(result).max())


def test_the_order_of_joints_in_a_file_changes_nothing() -> None:
    q = np.array([0.4, -0.7, 1.1])
    robot = arm()
    turned = replace(robot, joints=robot.joints[::-1])
    result, expected = (tip_compliance(structure_at(each, q)) for each in (turned, robot))
    assert result == pytest.approx(expected, rel=1e-9, abs=1e-18)


def test_shared_nodes_are_a_rigid_link_between_separate_ones() -> None:
    """Modes, coordinates, exact and coupled receptances agree with the same arm whose bodies have two nodes each."""
    q = np.array([0.4, -0.7, 1.1])
    shared = arm()
    apart = arm(((0, 1), (5, 2), (6, 3)))
    apart = replace(apart, links=(*apart.links, Link((1, 5)), Link((2, 6))))
    assert modes_at(shared, q).frequencies == pytest.approx(modes_at(apart, q).frequencies, rel=1e-8)
    structure = structure_at(shared, q)
    basis = coordinate_basis(structure)
    tip = basis[6 * structure.tip : 6 * structure.tip + 6]
    reduced = tip @ np.linalg.solve(basis.T @ stiffness_matrix(structure) @ basis, tip.T)
    assert reduced == pytest.approx(by_hand(q), rel=1e-9, abs=1e-15)
    lines = np.array([5.0, 20.0, 50.0])
    assert exact_frf_at(shared, q, lines).values == pytest.approx(exact_frf_at(apart, q, lines).values, rel=1e-7)


def test_what_is_taken_as_rigid_is_said(tmp_path: Path) -> None:
    source = Path(__file__).parents[3] / "millfrf" / "robot_model" / "robots" / "kuka_kr90_r3100.toml"
    text = source.read_text(encoding="utf-8")
    own = tmp_path / "shared.toml"
    elbow = "\n[[points]]\nnode = 3\nframe = '1'\nat_m = [0.35, 0.0, 0.0]\nsource = 'test'\n"
    own.write_text(text.replace("nodes = [3, 4]\nturning", "nodes = [2, 4]\nturning") + elbow, encoding="utf-8")
    case = read_spatial_robot(own)
    warnings = in_posture(case, case.poses["ready"]).warnings
    assert any("joints 1 and 2" in line and "node 2" in line and "rigid" in line for line in warnings)
    standard = read_spatial_robot("kuka_kr90_r3100")
    assert not any("rigid" in line for line in in_posture(standard, standard.poses["ready"]).warnings)


def test_a_node_on_two_bodies_is_refused() -> None:
    with pytest.raises(InputError, match=r"node 1 .*joint 3.*joint 1"):
        arm(((0, 1), (1, 2), (1, 3)))


def test_receptance_coupling_takes_shared_nodes() -> None:
    robot = arm()
    links = tuple(replace(link, section=None) for link in robot.links)
    tip = LumpedBody(4, "tool", 1.0, np.zeros(3), 0.01 * np.eye(3))
    whole = replace(robot, links=links, bodies=(*robot.bodies, tip))
    base = LumpedBody(0, "0", 1.0, np.zeros(3), np.eye(3))
    grounded = replace(whole, bodies=(*whole.bodies, base))
    q, lines = np.array([0.4, -0.7, 1.1]), np.array([5.0, 20.0])
    expected = exact_frf_at(whole, q, lines).values
    assert coupled_frf_at(grounded, q, lines).values == pytest.approx(expected, rel=1e-6, abs=1e-12)
