"""Every posture that holds the tool at a place: in closed form where there is one, else from several starts."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .mechanism import Frame, Mechanism
from .reaching import all_postures, reach_from
from .spherical_wrist import has_spherical_wrist, wrist_solutions

Real = NDArray[np.float64]

_ROUNDED = 1e-4
"""Angles (rad) and lengths (m) this near to those of a spherical wrist are rounding: 1.5708 for a quarter turn."""

_STARTS = 12
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
    found = all_postures(mechanism, target, start, starts=_STARTS)
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
