"""Inverse kinematics of any mechanism, by damped least squares from a start."""

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .loop_closure import close_loops, tool_jacobian
from .mechanism import Mechanism, rotation_vector

Real = NDArray[np.float64]


def inverse_kinematics(mechanism: Mechanism, target: Real, start: Real, *, tolerance: float = 1e-10) -> Real:
    """Find all joint values (n_moving,) that bring the tool to ``target``, near the driven values ``start``.

    Levenberg-Marquardt on position (m) and rotation vector (rad) together (Nakamura & Hanafusa 1986); closed loops
    are closed in every step.

    Parameters
    ----------
    mechanism
        Mechanism with its driven joints.
    target : (4, 4)
        Wanted tool frame in the base frame.
    start : (n_active,), rad or m
        Driven joint values to start from.
    tolerance
        Largest error that may remain, m and rad.

    Raises
    ------
    InputError
        The target is not reached from there.
    """
    driven, passive, damping = np.array(start, dtype=float), None, 1e-6
    q = close_loops(mechanism, driven, passive)
    error = _error(mechanism, q, target)
    for _ in range(200):
        if np.abs(error).max() < tolerance:
            return q
        jacobian = tool_jacobian(mechanism, q)
        normal = jacobian.T @ jacobian
        step = np.linalg.solve(normal + damping * np.eye(len(normal)), jacobian.T @ error)
        trial = driven + np.clip(step, -0.3, 0.3)
        try:
            q_trial = close_loops(mechanism, trial, q[~mechanism.active])
        except InputError:
            damping *= 10
            continue
        new = _error(mechanism, q_trial, target)
        if new @ new < error @ error:
            driven, q, error, damping = trial, q_trial, new, max(damping / 10, 1e-14)
        else:
            damping *= 10
    raise InputError(
        f"the tool does not reach {np.round(target[:3, 3], 4).tolist()} m in that attitude from the given start "
        f"(error {np.abs(error).max():.2g}); give a nearer start or another attitude"
    )


def _error(mechanism: Mechanism, q: Real, target: Real) -> Real:
    tool = mechanism.transforms(q)[mechanism.index(mechanism.tool)]
    return np.concatenate([target[:3, 3] - tool[:3, 3], rotation_vector(target[:3, :3] @ tool[:3, :3].T)])
