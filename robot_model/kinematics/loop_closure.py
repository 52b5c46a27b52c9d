"""Closed loops: passive joints that follow the driven ones, and the Jacobian that carries them along."""

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .mechanism import Frame, Mechanism, rotation_vector

Real = NDArray[np.float64]

_CLOSED = 1e-12
"""Largest gap of a loop that counts as closed, m and rad."""


def close_loops(mechanism: Mechanism, driven: Real, start: Real | None = None) -> Real:
    """Compute all joint values (n_moving,) from the driven ones, by Newton's method on the gaps of the cut joints.

    Each closure asks for equal origins and attitudes of two frames (Khalil & Kleinfinger 1986, section 4).

    Parameters
    ----------
    mechanism
        Mechanism with its closed loops.
    driven : (n_active,), rad or m
        Values of the driven joints.
    start : (n_passive,) or None
        Passive values to start from: they choose the assembly; None: zeros.

    Raises
    ------
    InputError
        Another number of driven values, or a loop that does not close there.
    """
    active = mechanism.active
    if np.shape(driven) != (int(active.sum()),):
        raise InputError(f"{np.size(driven)} joint values for {int(active.sum())} driven joints; give one each")
    q = np.zeros(len(active))
    q[active] = driven
    if not mechanism.closures:
        return q
    if start is not None:
        q[~active] = start
    for _ in range(50):
        placed = mechanism.transforms(q)
        gap = loop_gaps(mechanism, placed)
        if np.abs(gap).max() < _CLOSED:
            return q
        step = np.linalg.lstsq(loop_jacobian(mechanism, placed)[:, ~active], -gap, rcond=None)[0]
        q[~active] += np.clip(step, -0.5, 0.5)
    if np.abs(gap).max() < 1e3 * _CLOSED:
        return q
    raise InputError(
        f"a closed loop does not close at joint values {np.round(driven, 4).tolist()}; gap {np.abs(gap).max():.2g}"
    )


def loop_gaps(mechanism: Mechanism, placed: Real) -> Real:
    """Difference of position and attitude over each cut, shape (6 * n_closures,)."""
    gaps = []
    for first, second in mechanism.closures:
        a, b = placed[mechanism.index(first)], placed[mechanism.index(second)]
        gaps += [a[:3, 3] - b[:3, 3], rotation_vector(a[:3, :3] @ b[:3, :3].T)]
    return np.concatenate(gaps)


def loop_jacobian(mechanism: Mechanism, placed: Real) -> Real:
    """Derivative of the gaps over all joint values, near closure; shape (6 * n_closures, n_moving)."""
    pairs = [(mechanism.index(first), mechanism.index(second)) for first, second in mechanism.closures]
    return np.vstack([mechanism.jacobian(placed, a) - mechanism.jacobian(placed, b) for a, b in pairs])


def tool_jacobian(mechanism: Mechanism, q: Real) -> Real:
    """Velocity and rotation of the tool over the driven joints, loops kept closed; shape (6, n_active)."""
    placed = mechanism.transforms(q)
    whole = mechanism.jacobian(placed, mechanism.index(mechanism.tool))
    active = mechanism.active
    if not mechanism.closures:
        return whole[:, active]
    loops = loop_jacobian(mechanism, placed)
    follow = np.linalg.lstsq(loops[:, ~active], -loops[:, active], rcond=None)[0]
    return np.asarray(whole[:, active] + whole[:, ~active] @ follow)


def posture_warnings(mechanism: Mechanism, q: Real, least: float = 0.02) -> tuple[str, ...]:
    """Limits that are passed, and closeness to a singularity: one sentence each.

    A posture is near a singularity where the smallest singular value of the Jacobian (m, rad) is below ``least``.
    """
    warnings = []
    for index, value in zip(mechanism.moving, q, strict=True):
        frame = mechanism.frames[index]
        if not frame.lower <= value <= frame.upper:
            warnings.append(_outside(frame, float(value)))
    smallest = np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)[-1]
    if smallest < least:
        warnings.append(f"the posture is near a singularity: smallest singular value {smallest:.2g}")
    return tuple(warnings)


def _outside(frame: Frame, value: float) -> str:
    text = f"joint {frame.name} = {value:.4g} is outside {frame.lower:.4g} to {frame.upper:.4g}"
    if frame.motion == "prismatic":
        return f"{text} m"
    degrees = 180 / np.pi
    return f"{text} rad ({degrees * value:.1f} outside {degrees * frame.lower:.1f} to {degrees * frame.upper:.1f} deg)"
