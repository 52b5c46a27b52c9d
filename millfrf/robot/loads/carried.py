"""A payload and a force together at the tool: what the stiffness command adds up."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.robot_model import (
    STANDARD_GRAVITY,
    Payload,
    PlanarCase,
    SpatialCase,
    close_loops,
    payload_wrench,
    tool_attitude,
)

Real = NDArray[np.float64]


def carried_wrench(case: PlanarCase | SpatialCase, driven: Real, axes: Real | None, payload: Payload) -> Real:
    """Force and moment of a payload at the tool, over the degrees of freedom of its compliance, N and N m.

    Raises
    ------
    InputError
        A payload beside the tip of a planar robot.
    """
    if isinstance(case, PlanarCase):
        if any(payload.centre):
            raise InputError("a planar robot carries a payload at its tip: leave --payload-at out")
        return np.array([0.0, -payload.mass * STANDARD_GRAVITY, 0.0])
    mechanism = case.robot.mechanism
    attitude = tool_attitude(mechanism, close_loops(mechanism, driven))
    turn = np.eye(6) if axes is None else np.kron(np.eye(2), np.asarray(axes))
    return np.asarray(turn.T @ payload_wrench(case.robot, attitude, payload))


def largest_together(sag: Real, gain: Real) -> float:
    """``max |s + G u|`` over unit vectors u: the worst direction of a force of given size beside a fixed deflection.

    By repetition of ``u = G^T (s + G u) / |...|``, which never falls, from both ends of every principal direction.

    Examples
    --------
    >>> largest_together(np.array([0.0, 1.0]), np.diag([1.0, 2.0]))
    3.0
    """
    starts = np.linalg.svd(gain)[2]
    best = 0.0
    for u in (*starts, *(-starts)):
        for _ in range(200):
            pull = gain.T @ (sag + gain @ u)
            u = pull / max(float(np.linalg.norm(pull)), 1e-300)
        best = max(best, float(np.linalg.norm(sag + gain @ u)))
    return best
