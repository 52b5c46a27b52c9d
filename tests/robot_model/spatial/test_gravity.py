"""Weight as a stiffness: second derivative of the potential energy, the planar model, and the size of its effect."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from millfrf.core import InputError
from millfrf.robot_model import (
    SpatialRobot,
    modes_at,
    possible_changes,
    read_spatial_robot,
    structure_at,
    tip_compliance,
)
from millfrf.robot_model.finite_elements.statics import gravity_hessian, with_gravity
from millfrf.robot_model.model_updating.changes import with_rigid_links
from millfrf.robot_model.model_updating.weighed_changes import explain_frequencies

ROBOT = read_spatial_robot("staubli_rx170").robot
READY = read_spatial_robot("staubli_rx170").poses["ready"]


def energy(robot: SpatialRobot, q: np.ndarray) -> float:
    """``sum m g z`` of bodies and beams, whose middle carries their mass."""
    structure = structure_at(replace(robot, gravity=0.0), q)
    height = sum(body.mass * (structure.positions[body.node] + body.centre)[2] for body in structure.bodies)
    for beam in structure.beams:
        ends = structure.positions[list(beam.nodes)]
        height += beam.section.mass * np.linalg.norm(ends[1] - ends[0]) * ends[:, 2].mean()
    return float(9.81 * height)


@settings(max_examples=15)
@given(st.lists(st.floats(-1.5, 1.5), min_size=6, max_size=6))
def test_hessian_is_the_second_derivative_of_the_potential(angles: list[float]) -> None:
    robot, q, step = with_gravity(ROBOT, 9.81), np.array(angles), 1e-3
    result = gravity_hessian(robot, q, structure_at(robot, q))
    assert result == pytest.approx(result.T, abs=1e-9)
    unit = step * np.eye(6)
    pairs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    numeric = [
        [sum(i * j * energy(robot, q + i * a + j * b) for i, j in pairs) / (4 * step**2) for b in unit] for a in unit
    ]
    assert np.abs(result - np.array(numeric)).max() < 1e-5 * np.abs(result).max() + 2e-3


def test_weight_hardly_changes_a_robot_and_a_soft_one_falls() -> None:
    light, heavy = (modes_at(robot, READY).frequencies[:3] for robot in (ROBOT, with_gravity(ROBOT)))
    assert np.abs(heavy / light - 1).max() < 0.01
    assert np.abs(heavy / light - 1).max() > 1e-4
    statics = [tip_compliance(structure_at(robot, READY)) for robot in (ROBOT, with_gravity(ROBOT))]
    assert np.abs(statics[1] / statics[0] - 1)[2, 2] < 0.02
    upright = np.zeros(6)  # the arm stands on joint 2, which alone holds it against falling
    soft = ROBOT.with_stiffness(np.array([joint.stiffness for joint in ROBOT.joints]) * 0.003)
    modes_at(soft, upright)
    with pytest.raises(InputError, match="not held"):
        modes_at(with_gravity(soft), upright)


def test_rigid_links_weigh_what_flexible_ones_do() -> None:
    q = np.array([0.3, 0.4, 1.2, 0.2, 0.7, 0.1])
    flexible = with_gravity(ROBOT)
    rigid = with_rigid_links(flexible)
    result = [gravity_hessian(robot, q, structure_at(robot, q)) for robot in (flexible, rigid)]
    assert result[1] == pytest.approx(result[0], rel=1e-9, abs=1e-9)


def test_gravity_is_weighed_and_refused_where_it_cannot_be() -> None:
    assert "gravity" in {change.name for change in possible_changes(ROBOT)}
    assert "gravity" not in {change.name for change in possible_changes(with_gravity(ROBOT))}
    with pytest.raises(InputError, match="closed loops"):
        with_gravity(read_spatial_robot("fanuc_s420if").robot)
    with pytest.raises(InputError, match="-1"):
        with_gravity(ROBOT, -1.0)
    with pytest.raises(InputError, match="0 frequencies"):
        explain_frequencies(ROBOT, [])
