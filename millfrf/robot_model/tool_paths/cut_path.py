"""`CutPath`: tool places along a path, their files, and the rotary table that carries the work."""

import csv
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, Real, apart

from ..machining.path_compensation import MOMENTS, read_tool_path
from ..machining.redundancy import CutPlace

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


POSITION, AXIS, VECTOR, FORCE = (
    ("x_m", "y_m", "z_m"),
    ("i", "j", "k"),
    ("rx_rad", "ry_rad", "rz_rad"),
    ("fx_n", "fy_n", "fz_n"),
)

MOST_POINTS = 20_000
"""Points of a path that are taken."""


def read_cut_path(path: str | os.PathLike[str]) -> CutPath:
    """Read a path with ``x_m y_m z_m`` and either ``i j k`` or ``rx_rad ry_rad rz_rad``; forces may follow.

    ``i j k`` is the tool axis of a CAM system (ISO 4343, GOTO): from the tip towards the spindle. The rotation vector
    is that of the tool frame, whose z points into the work. With ``fx_n fy_n fz_n`` the path tells its own forces.

    Raises
    ------
    InputError
        No such file, or a path without two points apart.
    FileFormatError
        A column missing or no number, units that cannot be meant, more than 20000 points.
    """
    names = _names(path)
    if all(name in names for name in (*VECTOR, *FORCE)):
        known = read_tool_path(path)
        return cut_path(
            known.positions, scipy.spatial.transform.Rotation.from_rotvec(known.attitudes).as_matrix(), known.wrenches
        )
    tool = AXIS if all(name in names for name in AXIS) else VECTOR
    missing = [name for name in (*POSITION, *tool) if name not in names]
    if missing:
        raise FileFormatError(
            f"{path} lacks the columns {', '.join(missing)}; a path has x_m y_m z_m and i j k (tool axis, from the tip "
            "to the spindle) or rx_rad ry_rad rz_rad"
        )
    forces = FORCE if all(name in names for name in FORCE) else ()
    table = _table(path, (*POSITION, *tool, *forces, *(name for name in MOMENTS if forces and name in names)))
    if np.abs(table[:, :3]).max() > 20:
        raise FileFormatError(f"{path}: places up to {np.abs(table[:, :3]).max():g} m; give metres, at most 20")
    wrenches = None
    if forces:
        wrenches = np.zeros((len(table), 6))
        wrenches[:, : table.shape[1] - 6] = table[:, 6:]
    if tool == VECTOR:
        return cut_path(table[:, :3], scipy.spatial.transform.Rotation.from_rotvec(table[:, 3:6]).as_matrix(), wrenches)
    sizes = np.linalg.norm(table[:, 3:6], axis=1)
    if np.abs(sizes - 1).max() > 0.01:
        raise FileFormatError(
            f"{path}: i j k has the length {sizes[np.abs(sizes - 1).argmax()]:.3g}; it is a unit vector"
        )
    return cut_path(table[:, :3], attitudes_along(-table[:, 3:6]), wrenches)


def _rows(path: str | os.PathLike[str]) -> tuple[list[dict[str, str]], int]:
    """Rows of the table, and the number of the first one's line."""
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        with Path(path).open(newline="", encoding="utf-8") as stream:
            lines = stream.readlines()
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not UTF-8 text; save the path as CSV in UTF-8") from error
    kept = apart(lines)[1]
    return list(csv.DictReader(kept)), len(lines) - len(kept) + 2


def _names(path: str | os.PathLike[str]) -> tuple[str, ...]:
    rows, _ = _rows(path)
    if len(rows) < 2:
        raise FileFormatError(f"{path} has {len(rows)} rows; a path has two points or more")
    if len(rows) > MOST_POINTS:
        raise FileFormatError(f"{path} has {len(rows)} points; give at most {MOST_POINTS}, or every n-th of them")
    return tuple(name for name in rows[0] if name is not None)


def _table(path: str | os.PathLike[str], columns: tuple[str, ...]) -> np.ndarray:
    rows, first = _rows(path)
    table = np.empty((len(rows), len(columns)))
    for i, row in enumerate(rows):
        for j, name in enumerate(columns):
            try:
                table[i, j] = float(row[name])
            except (TypeError, ValueError) as error:
                raise FileFormatError(f"{path}: {name} = {row[name]!r} in line {first + i} is no number") from error
    if not np.isfinite(table).all():
        bad = int(np.argmin(np.isfinite(table).all(axis=1)))
        raise FileFormatError(f"{path}: line {first + bad} holds a number that is not finite")
    return table


@dataclass(frozen=True)
class RotaryTable:
    """Axis about which work, cut and tool turn together.

    Where the axis runs through the tip along the feed, the tip rests and the attitude alone turns: the second
    redundancy of Mousavi et al. (Fig. 10, theta_X7 = theta_Xw). Elsewhere the tip moves on a circle.

    Parameters
    ----------
    point : (3,), m
        A point of the axis in the base frame.
    direction : (3,)
        Direction of the axis; any length.

    Raises
    ------
    InputError
        A direction without length.
    """

    point: Real
    direction: Real

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.direction) > 1e-9:
            raise InputError(f"the table's axis {list(self.direction)} has no direction; give for example 1 0 0")

    def turned(self, place: CutPlace, angle: float) -> CutPlace:
        """The place after the table turned by ``angle``, rad."""
        if angle == 0.0:
            return place
        axis = np.asarray(self.direction) / np.linalg.norm(self.direction)
        turn = scipy.spatial.transform.Rotation.from_rotvec(angle * axis).as_matrix()
        position = self.point + turn @ (place.position - self.point)
        return CutPlace(position, turn @ place.attitude, turn @ place.axes)
