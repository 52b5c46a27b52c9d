"""Natural coordinates in space: the tool is where the frames put it, and constraints are what they say."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from millfrf.core import InputError
from millfrf.robot_model import read_spatial_robot
from millfrf.robot_model.machining.drilling_deviation import joint_deformation, joint_deviation
from millfrf.robot_model.natural_coordinates import natural_robot

CASE = read_spatial_robot("staubli_rx170")
ROBOT, READY = CASE.robot, CASE.poses["ready"]
NATURAL = natural_robot(ROBOT.mechanism, READY)


def test_coordinates_and_constraints_of_the_paper() -> None:
    kinds = Counter(NATURAL.identifiers())
    assert set(kinds) == {1000, 1001, 1002, 1003, 1004, 1005}
    assert kinds[1005] == 6
    assert len(NATURAL.start) == 27  # 4 points and 5 vectors, shared between neighbours


@settings(max_examples=30)
@given(st.lists(st.floats(-0.6, 0.6), min_size=6, max_size=6))
def test_the_tool_is_where_the_frames_put_it(change: list[float]) -> None:
    q = READY + np.array(change)
    x = NATURAL.place(q)
    expected = ROBOT.mechanism.transforms(q)[-1][:3, 3]
    assert NATURAL.tool_point(x) == pytest.approx(expected, abs=1e-9)


@settings(max_examples=10)
@given(st.lists(st.floats(-0.5, 0.5), min_size=27, max_size=27))
def test_jacobian_is_the_derivative(change: list[float]) -> None:
    x = NATURAL.start + np.array(change)
    _, rows = NATURAL.constraints(x, READY + 0.1)
    for column in range(len(x)):
        step = 1e-6 * np.eye(len(x))[column]
        slope = (NATURAL.constraints(x + step, READY + 0.1)[0] - NATURAL.constraints(x - step, READY + 0.1)[0]) / 2e-6
        assert rows[:, column] == pytest.approx(slope, abs=1e-7)


@pytest.mark.parametrize("elbow", [0.0, np.pi / 2, 2.4])
def test_a_straight_arm_is_no_singularity(elbow: float) -> None:
    """Two links at 0 degrees: the case that constraints by angles fail at."""
    q = READY.copy()
    q[2] = elbow
    steps = np.linspace(READY[2], elbow, 6)
    x = NATURAL.start
    for value in steps:
        q[2] = value
        x = NATURAL.place(q, x)
    assert NATURAL.tool_point(x) == pytest.approx(ROBOT.mechanism.transforms(q)[-1][:3, 3], abs=1e-9)


def test_drilling_deviation_by_natural_coordinates() -> None:
    wrench = np.array([0.0, 30.0, 1200.0, 0.0, 0.0, 2.6])
    moved = READY + joint_deformation(ROBOT, READY, wrench)
    deviation = NATURAL.tool_point(NATURAL.place(READY)) - NATURAL.tool_point(NATURAL.place(moved))
    assert deviation == pytest.approx(joint_deviation(ROBOT, READY, wrench), abs=1e-11)


def test_loops_are_refused() -> None:
    with pytest.raises(InputError, match="open chains"):
        natural_robot(read_spatial_robot("fanuc_s420if").robot.mechanism, np.zeros(9))
