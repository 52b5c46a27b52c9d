"""The closed form for any signs of the twists and any offsets, not for two robots alone."""

from math import pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from millfrf.robot_model import Frame, Mechanism, wrist_solutions

SIGN = st.sampled_from([-pi / 2, pi / 2])
LENGTH = st.floats(0.1, 1.5)
OFFSET = st.floats(-0.3, 0.3)


@st.composite
def mechanisms(draw: st.DrawFn) -> Mechanism:
    """Six revolute joints, spherical wrist, random twists, offsets, zeros and tool."""
    zero = [draw(st.floats(-1.5, 1.5)) for _ in range(6)]
    frames = (
        Frame("1", "0", theta=zero[0], r=draw(LENGTH)),
        Frame("2", "1", alpha=draw(SIGN), d=draw(OFFSET), theta=zero[1], r=draw(OFFSET)),
        Frame("3", "2", d=draw(LENGTH), theta=zero[2], r=draw(OFFSET)),
        Frame("4", "3", alpha=draw(SIGN), d=draw(OFFSET), theta=zero[3], r=draw(LENGTH)),
        Frame("5", "4", alpha=draw(SIGN), theta=zero[4]),
        Frame("6", "5", alpha=draw(SIGN), theta=zero[5], r=draw(OFFSET)),
        Frame("tool", "6", "fixed", alpha=draw(st.floats(-1, 1)), d=draw(OFFSET), r=draw(OFFSET)),
    )
    return Mechanism(frames, "tool")


@settings(max_examples=150)
@given(mechanisms(), st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6))
def test_all_branches_reach_and_the_posture_is_one_of_them(mechanism: Mechanism, q: list[float]) -> None:
    posture = np.array(q)
    placed = mechanism.transforms(posture)
    solutions = wrist_solutions(mechanism, placed[-1])
    for solution in solutions:
        assert mechanism.transforms(solution)[-1] == pytest.approx(placed[-1], abs=1e-6)
    jacobian = mechanism.jacobian(placed, 6)
    if np.linalg.svd(jacobian, compute_uv=False)[-1] > 1e-2:
        apart = np.abs((solutions - posture + pi) % (2 * pi) - pi).max(axis=1, initial=0.0)
        assert apart.min(initial=np.inf) < 1e-6
