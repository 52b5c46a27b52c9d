"""Inverse kinematics of any open chain: all branches, joint limits, the nearest posture."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import InputError, Real

from .mechanism import Frame, Mechanism, close_loops, rotation_vector, tool_jacobian
from .spherical_wrist import has_spherical_wrist, wrist_solutions


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


REACHED = 1e-9
"""Largest error of a posture that counts as reaching its target, m and rad."""

_SAME = 1e-5
"""Largest difference of two postures that count as one, rad and m."""

_REACHING_STARTS = 48
"""Starts over the joints' ranges, after the given one."""

_UNBOUNDED = np.pi, 2.0
"""Range of starts of joints without limits: rad, m."""


@dataclass(frozen=True)
class Nearest:
    """How near a mechanism comes to a target.

    Parameters
    ----------
    q : (n_moving,), rad or m
        Joint values of the posture that comes nearest.
    distance : m
        What is left to the target's place.
    angle : rad
        What is left to its attitude.
    at_limits
        Names of the joints that stand at a limit there.
    """

    q: Real
    distance: float
    angle: float
    at_limits: tuple[str, ...]


def reach(mechanism: Mechanism, target: Real, start: Real, *, starts: int = _REACHING_STARTS) -> Real:
    """Find the posture within the joint limits that brings the tool to ``target`` with the least motion.

    Levenberg-Marquardt with joints held at the limits that they push against (Nakamura & Hanafusa 1986 with an active
    set), from ``start`` and from a Halton sequence over the joints' ranges. Joints beyond six are then moved back
    towards the start as far as the tool allows: ``q += (I - J^+ J)(start - q)`` (Liegeois 1977).

    Parameters
    ----------
    mechanism
        Open chain; joints in the way to the tool move, others keep their start.
    target : (4, 4)
        Wanted tool frame in the base frame.
    start : (n_moving,), rad or m
        Posture from which motion counts.
    starts
        Number of starts after the given one.

    Returns
    -------
    (n_moving,), the posture with the smallest largest joint motion from ``start``

    Raises
    ------
    InputError
        Closed loops, or a target that no start reaches; the line says how near the tool comes.
    """
    found = all_postures(mechanism, target, start, starts=starts)
    if not len(found):
        raise InputError(_cannot(target, nearest_approach(mechanism, target, start, starts=starts)))
    return np.asarray(found[np.argmin(np.abs(found - start).max(axis=1))])


def all_postures(mechanism: Mechanism, target: Real, start: Real, *, starts: int = _REACHING_STARTS) -> Real:
    """Every posture that the starts lead to, within the limits, each once; shape (n, n_moving)."""
    found: list[Real] = []
    for number, first in enumerate(_starts(mechanism, start, starts)):
        q, error = _descend(mechanism, target, first)
        if error > REACHED:
            continue
        q = _back_to(mechanism, target, _fewest_turns(mechanism, q, start), start)
        if all(np.abs(q - other).max() > _SAME for other in found):
            found.append(q)
        if number == 0 and len(mechanism.moving) > 6:
            break  # endless ways reach it: the near one is meant
    return np.array(found).reshape(-1, len(mechanism.moving))


def reach_from(mechanism: Mechanism, target: Real, first: Real) -> Real | None:
    """The posture (n_moving,) that one start leads to, or None where it does not reach the target (4, 4)."""
    q, error = _descend(mechanism, target, first)
    return q if error <= REACHED else None


def nearest_approach(mechanism: Mechanism, target: Real, start: Real, *, starts: int = _REACHING_STARTS) -> Nearest:
    """The posture with the smallest error that the starts lead to."""
    tried = [_descend(mechanism, target, first) for first in _starts(mechanism, start, starts)]
    q = min(tried, key=lambda pair: pair[1])[0]
    error = _error(mechanism, q, target)
    lower, upper = _bounds(mechanism)
    at = tuple(
        mechanism.frames[index].name
        for index, value, low, high in zip(mechanism.moving, q, lower, upper, strict=True)
        if min(value - low, high - value) < 1e-6
    )
    return Nearest(q, float(np.linalg.norm(error[:3])), float(np.linalg.norm(error[3:])), at)


def _cannot(target: Real, near: Nearest) -> str:
    held = f"; joint {', '.join(near.at_limits)} is at its limit there" if near.at_limits else ""
    return (
        f"the tool does not reach {np.round(target[:3, 3], 4).tolist()} m in that attitude: it comes within "
        f"{1e3 * near.distance:.3g} mm and {np.degrees(near.angle):.3g} degrees{held}; move or turn the cut"
    )


def _starts(mechanism: Mechanism, start: Real, count: int) -> Real:
    """The given start, then a Halton sequence over the ranges; the same at every call."""
    if mechanism.closures:
        raise InputError("a robot with closed loops is aimed in steps: inverse_kinematics")
    frames = [mechanism.frames[index] for index in mechanism.moving]
    ranges = np.array([_range(frame, value) for frame, value in zip(frames, start, strict=True)])
    spread = scipy.stats.qmc.Halton(len(frames), scramble=False).random(count + 1)[1:]
    lower, upper = _bounds(mechanism)
    return np.vstack([np.clip(start, lower, upper), ranges[:, 0] + spread * (ranges[:, 1] - ranges[:, 0])])


def _range(frame: Frame, value: float) -> tuple[float, float]:
    half = _UNBOUNDED[frame.motion == "prismatic"]
    lower = frame.lower if np.isfinite(frame.lower) else value - half
    upper = frame.upper if np.isfinite(frame.upper) else value + half
    if frame.motion == "revolute" and lower <= -half and upper >= half:
        return -half, half  # one turn holds every attitude
    return lower, upper


def _bounds(mechanism: Mechanism) -> tuple[Real, Real]:
    frames = [mechanism.frames[index] for index in mechanism.moving]
    return np.array([frame.lower for frame in frames]), np.array([frame.upper for frame in frames])


def _descend(mechanism: Mechanism, target: Real, first: Real, most: int = 80) -> tuple[Real, float]:
    """Posture and its largest error, m or rad; joints that push against a limit are held there."""
    lower, upper = _bounds(mechanism)
    tool = mechanism.index(mechanism.tool)
    q, damping = np.clip(first, lower, upper), 1e-4
    error = _error(mechanism, q, target)
    for _ in range(most):
        if np.abs(error).max() < 1e-12:
            break
        jacobian = mechanism.jacobian(mechanism.transforms(q), tool)
        slope = jacobian.T @ error
        free = ~(((q <= lower) & (slope < 0)) | ((q >= upper) & (slope > 0)))
        reduced = jacobian[:, free]
        step = np.zeros(len(q))
        step[free] = np.linalg.solve(reduced.T @ reduced + damping * np.eye(int(free.sum())), slope[free])
        trial = np.clip(q + np.clip(step, -0.5, 0.5), lower, upper)
        new = _error(mechanism, trial, target)
        gain = error @ error - new @ new
        if gain > 0:
            settled = gain < 1e-14 * (error @ error)
            q, error, damping = trial, new, max(damping / 10, 1e-12)
            if settled:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
    return q, float(np.abs(error).max())


def _back_to(mechanism: Mechanism, target: Real, q: Real, start: Real) -> Real:
    """Move joints beyond six towards the start while the tool stays."""
    if len(q) <= 6:
        return q
    tool = mechanism.index(mechanism.tool)
    for _ in range(20):
        jacobian = mechanism.jacobian(mechanism.transforms(q), tool)
        towards = (start - q) - np.linalg.pinv(jacobian) @ (jacobian @ (start - q))
        if np.abs(towards).max() < 1e-9:
            break
        trial, error = _descend(mechanism, target, q + towards)
        if error > REACHED or np.linalg.norm(trial - start) > np.linalg.norm(q - start) - 1e-12:
            break
        q = trial
    return q


def _fewest_turns(mechanism: Mechanism, q: Real, start: Real) -> Real:
    """Whole turns of revolute joints taken off or added, within the limits, so that they move least."""
    lower, upper = _bounds(mechanism)
    chosen = q.copy()
    for place, index in enumerate(mechanism.moving):
        if mechanism.frames[index].motion != "revolute":
            continue
        turns = 2 * np.pi * np.arange(-3, 4) + q[place]
        allowed = turns[(turns >= lower[place] - 1e-12) & (turns <= upper[place] + 1e-12)]
        if len(allowed):
            chosen[place] = allowed[np.argmin(np.abs(allowed - start[place]))]
    return chosen


_ROUNDED = 1e-4
"""Angles (rad) and lengths (m) this near to those of a spherical wrist are rounding: 1.5708 for a quarter turn."""

_BRANCHES_STARTS = 12
"""Starts of a robot without closed form."""


def tool_postures(mechanism: Mechanism, target: Real, near: Real | None = None) -> Real:
    """Postures within the limits that bring the tool to ``target``, shape (n, n_moving); empty where none does.

    Spherical wrists have up to 8, in closed form. A robot that is one but for rounding starts from those and is
    corrected to its own numbers. Others are searched from ``near`` and from starts over the joints' ranges: not every
    branch need be found; those found are in the order of their motion from ``near``.

    Parameters
    ----------
    mechanism
        Mechanism of the robot, an open chain.
    target : (4, 4)
        Wanted tool frame in the base frame.
    near : (n_moving,), rad or m
        Posture from which motion counts; None: the middle of the joints' ranges.
    """
    if mechanism.closures or has_spherical_wrist(mechanism):  # loops are refused there
        return wrist_solutions(mechanism, target)
    ideal = _rounded(mechanism)
    if has_spherical_wrist(ideal):
        return _corrected(mechanism, target, wrist_solutions(_widened(ideal), target))
    start = _middle(mechanism) if near is None else near
    found = all_postures(mechanism, target, start, starts=_BRANCHES_STARTS)
    return np.asarray(found[np.argsort(np.abs(found - start).max(axis=1))]) if len(found) else found


def _corrected(mechanism: Mechanism, target: Real, starts: Real) -> Real:
    """The postures of the rounded robot, brought to the target by the robot itself."""
    found = [q for first in starts if (q := reach_from(mechanism, target, first)) is not None]
    return np.array(found).reshape(-1, len(mechanism.moving))


def _rounded(mechanism: Mechanism) -> Mechanism:
    """The mechanism with nearly right angles made right, and nearly absent lengths left out."""

    def right(angle: float) -> float:
        quarter = np.pi / 2 * round(angle / (np.pi / 2))
        return float(quarter) if abs(angle - quarter) < _ROUNDED else angle

    def clean(frame: Frame) -> Frame:
        lengths = {name: 0.0 for name in ("b", "d", "r") if abs(getattr(frame, name)) < _ROUNDED}
        gamma = 0.0 if abs(frame.gamma) < _ROUNDED else frame.gamma
        return replace(frame, alpha=right(frame.alpha), gamma=gamma, **lengths)  # type: ignore[arg-type]

    moving = {mechanism.frames[index].name for index in mechanism.moving}
    frames = tuple(clean(frame) if frame.name in moving else frame for frame in mechanism.frames)
    return replace(mechanism, frames=frames)


def _widened(mechanism: Mechanism) -> Mechanism:
    """Limits a little wider, so that rounding loses no posture at a limit."""
    frames = tuple(replace(f, lower=f.lower - _ROUNDED, upper=f.upper + _ROUNDED) for f in mechanism.frames)
    return replace(mechanism, frames=frames)


def _middle(mechanism: Mechanism) -> Real:
    frames = [mechanism.frames[index] for index in mechanism.moving]
    known = [frame if np.isfinite(frame.lower) and np.isfinite(frame.upper) else None for frame in frames]
    return np.array([0.0 if frame is None else (frame.lower + frame.upper) / 2 for frame in known])
