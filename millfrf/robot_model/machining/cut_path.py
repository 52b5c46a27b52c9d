"""Places of a cut: postures over a redundancy angle at one place, paths, and the rotary table of a workpiece."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, Real
from modal_fit import ModalModel

from ..kinematics.inverse import tool_postures
from ..kinematics.mechanism import Mechanism
from ..settings import ROBOT
from ..spatial.spatial_modes import model_of_modes, modes_at
from ..spatial.spatial_robot import SpatialRobot
from .path_compensation import MOMENTS, check_places, number_table, path_rows, read_tool_path


@dataclass(frozen=True)
class CutPlace:
    """Position and attitude of the tool in a cut, and the axes of the cut.

    Parameters
    ----------
    position : (3,), m
        Position of the tool tip in the base frame.
    attitude : (3, 3)
        Tool frame in the base frame, as columns x, y, z; z points along the tool.
    axes : (3, 3)
        Feed, normal and axial direction of the cut as columns, in the base frame.
    """

    position: Real
    attitude: Real
    axes: Real


@dataclass(frozen=True)
class PostureMap:
    """Value of a criterion at each redundancy angle.

    Parameters
    ----------
    angles : (n_angles,), rad
        Redundancy angles that were tried.
    values : (n_angles,)
        Values of the criterion; NaN exactly where ``reached`` is False.
    q : (n_angles, n_moving), rad or m
        Joint values behind each value; NaN where the place is not reached.
    frequencies : (n_angles,), Hz
        Lowest natural frequency at each angle.
    reached : (n_angles,), bool
        Whether the robot reaches the place at the angle.
    """

    angles: Real
    values: Real
    q: Real
    frequencies: Real
    reached: NDArray[np.bool_]

    def best(self) -> int:
        """Return the index of the largest value; raise an `InputError` if no angle is reached."""
        if not self.reached.any():
            raise InputError("no redundancy angle is reached; move the cut nearer to the robot")
        return int(np.argmax(np.where(self.reached, self.values, -np.inf)))


def posture_map(
    robot: SpatialRobot,
    place: CutPlace,
    angles: Real,
    criterion: Callable[[ModalModel], float],
    *,
    redundancy: str = "table",
    branches: str = "best",
) -> PostureMap:
    """Evaluate a criterion (a depth limit, a stiffness) over a redundancy angle.

    Parameters
    ----------
    robot
        Robot, an open chain.
    place
        Position and attitude of the tool, and axes of the cut.
    angles : (n_angles,), rad
        Redundancy angles to try.
    criterion
        Function of the modal model in the axes of the cut (feed, normal, axial); larger values are better.
    redundancy
        ``tool``: the robot turns about the tool's axis, the cut stays (first redundancy of Mousavi et al., Fig. 9).
        ``table``: tool, workpiece and cut turn together about the feed direction while the tip stays, because a rotary
        table carries the workpiece (second redundancy, Fig. 10: theta_X7 = theta_Xw).
    branches
        ``best``: the branch with the largest value; ``near``: the first branch at the first angle, then the branch
        nearest to the last posture, as a robot would move.

    Raises
    ------
    InputError
        An unknown redundancy or rule for branches.
    """
    if redundancy not in ("tool", "table") or branches not in ("best", "near"):
        raise InputError(f"redundancy {redundancy!r}, branches {branches!r}: use tool or table, best or near")
    n = len(angles)
    values, q, lowest = np.full(n, np.nan), np.full((n, len(robot.mechanism.moving)), np.nan), np.full(n, np.nan)
    last: Real | None = None
    for i, angle in enumerate(angles):
        turned = turned_place(place, float(angle), redundancy)
        if branches == "near":
            nearest = nearest_branch(robot.mechanism, turned, last)
            solutions = np.zeros((0, q.shape[1])) if nearest is None else nearest[None]
        else:
            solutions = tool_postures(robot.mechanism, target_of(turned), last)
        for posture in solutions:
            modes = modes_at(robot, posture)
            value = criterion(model_of_modes(modes, robot, axes=turned.axes))
            if np.isnan(values[i]) or value > values[i]:
                values[i], q[i], lowest[i] = value, posture, modes.frequencies[0]
        last = q[i] if len(solutions) else last
    return PostureMap(np.asarray(angles, dtype=float), values, q, lowest, ~np.isnan(values))


def turned_place(place: CutPlace, angle: float, redundancy: str) -> CutPlace:
    """Return the place after rotation by ``angle`` (rad) about the redundancy ``tool`` or ``table``."""
    if redundancy == "tool":
        return CutPlace(place.position, _rotation(angle * place.attitude[:, 2]) @ place.attitude, place.axes)
    about_feed = _rotation(angle * place.axes[:, 0])
    return CutPlace(place.position, about_feed @ place.attitude, about_feed @ place.axes)


def _rotation(vector: Real) -> Real:
    return np.asarray(scipy.spatial.transform.Rotation.from_rotvec(vector).as_matrix())


def target_of(place: CutPlace) -> Real:
    """Return the tool frame of a place as a homogeneous matrix, (4, 4)."""
    target = np.eye(4)
    target[:3, :3], target[:3, 3] = place.attitude, place.position
    return target


def tool_down(position: Sequence[float], feed: float = 0.0) -> CutPlace:
    """Return the place of a vertical tool, z downwards, that feeds horizontally at ``feed`` rad from the base's x."""
    cosine, sine = np.cos(feed), np.sin(feed)
    axes = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    attitude = axes @ np.diag([1.0, -1.0, -1.0])
    return CutPlace(np.asarray(position, dtype=float), attitude, axes)


def nearest_branch(mechanism: Mechanism, place: CutPlace, last: Real | None) -> Real | None:
    """Return the posture at a place that is nearest to the ``last`` posture; None if the place is not reached.

    Without a ``last`` posture, return the first posture that is found.
    """
    solutions = tool_postures(mechanism, target_of(place), last)
    if not len(solutions):
        return None
    return np.asarray(solutions[0] if last is None else solutions[np.argmin(np.abs(solutions - last).max(axis=1))])


def frequencies_over(
    robot: SpatialRobot, places: Sequence[CutPlace], n_modes: int = 6
) -> tuple[Real, NDArray[np.bool_]]:
    """Compute the lowest natural frequencies along places, Hz, (n_places, n_modes), and which are reached, (n_places,).

    Each posture is on the branch nearest to the posture at the place before; frequencies are NaN if a place is not
    reached.
    """
    table, reached = np.full((len(places), n_modes), np.nan), np.zeros(len(places), dtype=bool)
    last: Real | None = None
    for i, place in enumerate(places):
        q = nearest_branch(robot.mechanism, place, last)
        if q is not None:
            table[i], reached[i], last = modes_at(robot, q).frequencies[:n_modes], True, q
    return table, reached


@dataclass(frozen=True)
class CutPath:
    """Places of a tool path in the order in which they are cut.

    Parameters
    ----------
    places
        Position and attitude of the tool, and axes of the cut: X feed, Y normal, Z against the tool's z.
    wrenches : (n, 6), N and N m, or None
        Forces and moments on the tool in the base frame, if the path gives them.
    plunges : (n,), bool
        Points at which the tool moves along its axis; they have the feed direction of the nearest point that does not
        plunge.
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
        """Length of the path from the first point to each point, m, (n,)."""
        steps = np.linalg.norm(np.diff(self.positions, axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])


@dataclass(frozen=True)
class PathSegment:
    """Part of a path.

    Parameters
    ----------
    lengths : m
        Length of the path up to the beginning and up to the end.
    places
        Beginning, middle and end, each with the feed direction inside the segment.
    feed_turn : rad
        Largest angle between the feed anywhere in the segment and that of the nearest of the places in direction.
    """

    lengths: tuple[float, float]
    places: tuple[CutPlace, CutPlace, CutPlace]
    feed_turn: float


def path_segments(path: CutPath, count: int | None = None) -> tuple[PathSegment, ...]:
    """Divide a path at its points, or into ``count`` parts of equal length.

    Between two points the tip moves on a straight line in the feed direction of the first one, and the tool turns at a
    constant rate. Points at which the tip rests end no segment.

    Parameters
    ----------
    path
        Path with two different points or more.
    count
        Number of parts; None: at the points.

    Raises
    ------
    InputError
        Parts shorter than a micrometre.
    """
    lengths, near = path.lengths, ROBOT.same_point
    ends = lengths[np.append(True, np.diff(lengths) > near)]
    if count is not None:
        if lengths[-1] <= 1e-6 * count:
            raise InputError(f"{count} segments of a path of {lengths[-1]:.3g} m are shorter than 1 um; give fewer")
        ends = np.linspace(0.0, lengths[-1], count + 1)
    segments = []
    for begin, end in pairwise(ends.tolist()):
        first = int(np.searchsorted(lengths, begin + near, side="right")) - 1
        last = int(np.searchsorted(lengths, end - near, side="left")) - 1
        middle = int(np.searchsorted(lengths, (begin + end) / 2, side="right")) - 1
        at = ((begin, first), ((begin + end) / 2, middle), (end, last))
        places = tuple(_place_between(path, length, row) for length, row in at)
        feeds = np.array([place.axes[:, 0] for place in path.places[first : last + 1]])
        nearest = (feeds @ feeds[[0, middle - first, -1]].T).max(axis=1)
        turn = float(np.arccos(np.clip(nearest.min(), -1.0, 1.0)))
        segments.append(PathSegment((begin, end), (places[0], places[1], places[2]), turn))
    return tuple(segments)


def _place_between(path: CutPath, length: float, row: int) -> CutPlace:
    """Return the place at a length (m) between the points ``row`` and ``row + 1``, with the feed of the first."""
    first, second = path.places[row], path.places[row + 1]
    begin, end = path.lengths[row], path.lengths[row + 1]
    share = float(np.clip((length - begin) / (end - begin), 0.0, 1.0))
    rotation = scipy.spatial.transform.Rotation
    turn = share * rotation.from_matrix(second.attitude @ first.attitude.T).as_rotvec()
    turned = rotation.from_rotvec(turn).as_matrix()
    position = first.position + share * (second.position - first.position)
    return CutPlace(position, turned @ first.attitude, turned @ first.axes)


def cut_path(positions: Real, attitudes: Real, wrenches: Real | None = None) -> CutPath:
    """Build a path whose feed direction at each point leads to the next point, projected across the tool.

    Parameters
    ----------
    positions : (n, 3), m
        Positions of the tool tip in the base frame.
    attitudes : (n, 3, 3)
        Tool frames in the base frame as columns; z points along the tool, into the workpiece.
    wrenches : (n, 6) or None
        Forces and moments on the tool.

    Raises
    ------
    InputError
        Fewer than two different points, or a path that only plunges.
    """
    positions = np.asarray(positions, dtype=float)
    feeds, known = _feeds(positions, np.asarray(attitudes)[:, :, 2])
    if not known.any():
        raise InputError(
            "the path needs two different points with feed across the tool; this one only plunges, or rests"
        )
    with_feed = np.flatnonzero(known)
    places = []
    for i, (position, attitude) in enumerate(zip(positions, attitudes, strict=True)):
        feed = feeds[with_feed[np.argmin(np.abs(with_feed - i))]]
        axial = -attitude[:, 2]
        across = feed - (feed @ axial) * axial
        across /= np.linalg.norm(across)
        axes = np.column_stack([across, np.cross(axial, across), axial])
        places.append(CutPlace(position, attitude, axes))
    return CutPath(tuple(places), wrenches, ~known)


def _feeds(positions: Real, along: Real) -> tuple[Real, NDArray[np.bool_]]:
    """Compute the direction to the next different point, (n, 3), and whether it leads across the tool, (n,)."""
    feeds, known = np.zeros_like(positions), np.zeros(len(positions), dtype=bool)
    direction = np.zeros(3)
    for i in range(len(positions) - 1, -1, -1):  # backwards, so that a resting point has the next feed
        step = positions[i + 1] - positions[i] if i + 1 < len(positions) else np.zeros(3)
        length = float(np.linalg.norm(step))
        direction = step / length if length > ROBOT.same_point else direction
        feeds[i] = direction
    if len(positions) > 1:
        feeds[-1] = feeds[-2]
    for i, (feed, tool) in enumerate(zip(feeds, along, strict=True)):
        known[i] = float(np.linalg.norm(feed - (feed @ tool) * tool)) > ROBOT.plunge
    return feeds, known


def attitudes_along(tool_axes: Real) -> Real:
    """Build tool frames from tool axes, transported along the path without rotation about the tool, (n, 3, 3).

    The x axis of the first frame is the base's x axis, projected across the tool. Each next frame is turned by the
    smallest angle that aligns the tool axis, so that angle zero of the redundancy does not jump at a corner.

    Parameters
    ----------
    tool_axes : (n, 3)
        Directions of the tool's z, into the workpiece; any length.

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
        if np.linalg.norm(side) < 1e-6:  # the new axis is along the old side
            side = np.cross(axis, frames[-1][:, 1]) if frames else np.eye(3)[1]
        side = side / np.linalg.norm(side)
        frames.append(np.column_stack([side, np.cross(axis, side), axis]) + 0.0)
    return np.array(frames)


POSITION, AXIS = ("x_m", "y_m", "z_m"), ("i", "j", "k")
ROTATION, FORCE = ("rx_rad", "ry_rad", "rz_rad"), ("fx_n", "fy_n", "fz_n")


def read_cut_path(path: str | os.PathLike[str]) -> CutPath:
    """Read a path with ``x_m y_m z_m`` and either ``i j k`` or ``rx_rad ry_rad rz_rad``; forces are optional.

    ``i j k`` is the tool axis of a CAM system (ISO 4343, GOTO): from the tip towards the spindle. The rotation vector
    is that of the tool frame, whose z points into the workpiece. ``fx_n fy_n fz_n`` are the forces on the tool.

    Raises
    ------
    InputError
        No such file, or a path without two different points.
    FileFormatError
        A column that is missing or not numeric, values that are too large for their unit, or more than 20000 points.
    """
    rows, first = path_rows(path)
    names = _column_names(path, rows)
    if all(name in names for name in (*ROTATION, *FORCE)):
        tool_path = read_tool_path(path)
        return cut_path(tool_path.positions, _matrices(tool_path.attitudes), tool_path.wrenches)
    tool = AXIS if all(name in names for name in AXIS) else ROTATION
    missing = [name for name in (*POSITION, *tool) if name not in names]
    if missing:
        raise FileFormatError(
            f"{path} lacks the columns {', '.join(missing)}; a path has x_m y_m z_m and i j k (tool axis, from the tip "
            "to the spindle) or rx_rad ry_rad rz_rad"
        )
    forces = FORCE if all(name in names for name in FORCE) else ()
    moments = tuple(name for name in MOMENTS if forces and name in names)
    table = number_table(path, rows, first, (*POSITION, *tool, *forces, *moments))
    check_places(path, table[:, :3])
    wrenches = None
    if forces:
        wrenches = np.zeros((len(table), 6))
        wrenches[:, : table.shape[1] - 6] = table[:, 6:]
    if tool == ROTATION:
        return cut_path(table[:, :3], _matrices(table[:, 3:6]), wrenches)
    lengths = np.linalg.norm(table[:, 3:6], axis=1)
    if np.abs(lengths - 1).max() > 0.01:  # CAM systems round to three digits or more
        raise FileFormatError(
            f"{path}: i j k has the length {lengths[np.abs(lengths - 1).argmax()]:.3g}; it is a unit vector"
        )
    return cut_path(table[:, :3], attitudes_along(-table[:, 3:6]), wrenches)


def _column_names(path: str | os.PathLike[str], rows: list[dict[str, str]]) -> tuple[str, ...]:
    if len(rows) < 2:
        raise FileFormatError(f"{path} has {len(rows)} rows; a path has two points or more")
    most = ROBOT.most_path_points
    if len(rows) > most:
        raise FileFormatError(f"{path} has {len(rows)} points; give at most {most}, or every n-th of them")
    return tuple(name for name in rows[0] if name is not None)


def _matrices(rotation_vectors: Real) -> Real:
    return np.asarray(scipy.spatial.transform.Rotation.from_rotvec(rotation_vectors).as_matrix())


@dataclass(frozen=True)
class RotaryTable:
    """Axis about which workpiece, cut and tool turn together.

    If the axis passes through the tip along the feed, the tip rests and only the attitude turns: the second redundancy
    of Mousavi et al. (Fig. 10, theta_X7 = theta_Xw). Otherwise the tip moves on a circle.

    Parameters
    ----------
    point : (3,), m
        A point of the axis in the base frame.
    direction : (3,)
        Direction of the axis; any length above zero.
    """

    point: Real
    direction: Real

    def __post_init__(self) -> None:
        if not np.linalg.norm(self.direction) > 1e-9:
            raise InputError(f"the table's axis {list(self.direction)} has no direction; give for example 1 0 0")

    def turned(self, place: CutPlace, angle: float) -> CutPlace:
        """Return the place after rotation of the table by ``angle``, rad."""
        if angle == 0.0:
            return place
        axis = np.asarray(self.direction) / np.linalg.norm(self.direction)
        turn = _matrices(angle * axis)
        position = self.point + turn @ (place.position - self.point)
        return CutPlace(position, turn @ place.attitude, turn @ place.axes)
