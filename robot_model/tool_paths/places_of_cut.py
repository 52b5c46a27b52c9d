"""`CutPath`: places of the tool along a path with the axes of the cut at each of them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..machining import CutPlace

Real = NDArray[np.float64]

_SAME = 1e-9
"""Distance below which two points are one, m."""

_PLUNGE = 0.05
"""Sine of the angle between feed and tool below which the tool plunges: there is no feed across it."""


@dataclass(frozen=True)
class CutPath:
    """Places of a tool path in the order in which they are cut.

    Parameters
    ----------
    places
        Position and attitude of the tool, and axes of the cut: X feed, Y normal, Z against the tool's z.
    wrenches : (n, 6), N and N m, or None
        Forces and moments on the tool in the base frame, where the path tells them.
    plunges : (n,), bool
        Points at which the tool moves along its own axis: the feed direction of a neighbour stands in.
    """

    places: tuple[CutPlace, ...]
    wrenches: Real | None
    plunges: NDArray[np.bool_]

    @property
    def positions(self) -> Real:
        """Positions of the tool tip, m, (n, 3)."""
        return np.array([place.position for place in self.places])

    @property
    def lengths(self) -> Real:
        """Way from the first point to each point, m, (n,)."""
        steps = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])


def cut_path(positions: Real, attitudes: Real, wrenches: Real | None = None) -> CutPath:
    """Build a path whose feed at each point is directed to the next one, across the tool.

    Parameters
    ----------
    positions : (n, 3), m
        Positions of the tool tip in the base frame.
    attitudes : (n, 3, 3)
        Tool frames in the base frame as columns; z points along the tool, into the work.
    wrenches : (n, 6) or None
        Forces and moments on the tool.

    Raises
    ------
    InputError
        Fewer than two different points, or a path that plunges all along.
    """
    positions = np.asarray(positions, dtype=float)
    feeds, known = _feeds(positions, np.asarray(attitudes)[:, :, 2])
    if not known.any():
        raise InputError(
            "the path needs two different points with feed across the tool; this one only plunges, or rests"
        )
    nearest = np.flatnonzero(known)
    places = []
    for i, (position, attitude) in enumerate(zip(positions, attitudes, strict=True)):
        feed = feeds[nearest[np.argmin(np.abs(nearest - i))]]
        axial = -attitude[:, 2]
        across = feed - (feed @ axial) * axial
        across /= np.linalg.norm(across)
        axes = np.column_stack([across, np.cross(axial, across), axial])
        places.append(CutPlace(position, attitude, axes))
    return CutPath(tuple(places), wrenches, ~known)


def _feeds(positions: Real, along: Real) -> tuple[Real, NDArray[np.bool_]]:
    """Unit direction to the next different point, and whether it has a part across the tool."""
    feeds, known = np.zeros_like(positions), np.zeros(len(positions), dtype=bool)
    last = np.zeros(3)
    for i in range(len(positions) - 1, -1, -1):
        step = positions[i + 1] - positions[i] if i + 1 < len(positions) else np.zeros(3)
        length = float(np.linalg.norm(step))
        last = step / length if length > _SAME else last
        feeds[i] = last
    if len(positions) > 1:
        feeds[-1] = feeds[-2]
    for i, (feed, tool) in enumerate(zip(feeds, along, strict=True)):
        known[i] = float(np.linalg.norm(feed - (feed @ tool) * tool)) > _PLUNGE
    return feeds, known


def attitudes_along(tool_axes: Real) -> Real:
    """Tool frames from tool axes alone, carried along the path without turning about the tool, (n, 3, 3).

    The first frame has x as near to the base's x as the axis allows; each next one is turned by the smallest rotation
    that brings the axis over, so that angle zero of the redundancy does not jump at a corner.

    Parameters
    ----------
    tool_axes : (n, 3)
        Directions of the tool's z, into the work; any length.

    Examples
    --------
    >>> attitudes_along(np.array([[0.0, 0.0, -1.0]]))[0].tolist()
    [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]
    """
    axes = tool_axes / np.linalg.norm(tool_axes, axis=1)[:, None]
    side = np.eye(3)[0] if abs(axes[0][0]) < 0.9 else np.eye(3)[2]
    frames: list[Real] = []
    for axis in axes:
        side = side - (side @ axis) * axis
        if np.linalg.norm(side) < 1e-6:
            side = np.cross(axis, frames[-1][:, 1]) if frames else np.eye(3)[1]
        side = side / np.linalg.norm(side)
        frames.append(np.column_stack([side, np.cross(axis, side), axis]) + 0.0)
    return np.array(frames)
