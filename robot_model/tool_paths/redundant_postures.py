"""Every posture that holds the tool at a point of a path, over the redundancy: what a sequence is chosen from."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..kinematics import has_spherical_wrist, inverse_kinematics, tool_postures, wrist_solutions
from ..machining import CutPlace, target_of, turned_place
from ..spatial import SpatialRobot
from .joint_margins import limit_margin, singular_values
from .places_of_cut import CutPath
from .rotary_table import RotaryTable

Real = NDArray[np.float64]

_APART = 1e-4
"""Largest joint difference of two solutions that count as one, rad."""

_SEEDS = 4
"""Starts from which an iterated solution is searched at one angle."""


@dataclass(frozen=True)
class Redundancy:
    """Angles over which postures are sampled, and what a posture must keep.

    Parameters
    ----------
    tool : (n_tool,), rad
        Turns of the robot about the tool's axis.
    table : (n_table,), rad
        Turns of the rotary table; zero alone where there is none.
    rotary : RotaryTable or None
        Axis of the table.
    limit_margin : rad
        Least distance to a joint limit (prismatic joints: m).
    least_singular_value
        Least singular value of the tool Jacobian (m, rad).
    """

    tool: Real
    table: Real
    rotary: RotaryTable | None = None
    limit_margin: float = 0.0
    least_singular_value: float = 0.05

    def place(self, place: CutPlace, tool: float, table: float) -> CutPlace:
        """A place of the path after both redundancies turned, rad."""
        carried = place if self.rotary is None else self.rotary.turned(place, table)
        return turned_place(carried, tool, "tool") if tool else carried


@dataclass(frozen=True)
class PointPostures:
    """Postures that reach one point.

    Parameters
    ----------
    q : (n, n_moving), rad and m
        Joint values of each posture.
    tool, table : (n,), rad
        Redundancy angles of each posture.
    margin : (n,), rad (m)
        Distance to the nearest joint limit.
    smallest, condition : (n,)
        Smallest singular value and condition number of the tool Jacobian.
    same : (n,)
        Number of the place of all links: postures that differ by whole turns of joints share it.
    """

    q: Real
    tool: Real
    table: Real
    margin: Real
    smallest: Real
    condition: Real
    same: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.q)


def path_postures(robot: SpatialRobot, path: CutPath, free: Redundancy, start: Real) -> list[PointPostures]:
    """Give all postures at every point of a path, over the sampled redundancy.

    Robots with a spherical wrist: every branch in closed form. Others: the branches that damped least squares reaches
    from ``start``, from the neighbouring angle and from the point before.

    Parameters
    ----------
    robot
        Robot whose joints hold the tool.
    path
        Places of the tool.
    free
        Angles, and the least margins.
    start : (n_active,), rad or m
        Driven joint values from which the search begins.

    Returns
    -------
    list
        One entry a point, without postures where nothing reaches it.
    """
    found: list[PointPostures] = []
    mechanism, seeds = robot.mechanism, [start]
    if not mechanism.closures and not has_spherical_wrist(mechanism):
        target = target_of(free.place(path.places[0], float(free.tool[0]), float(free.table[0])))
        seeds += list(tool_postures(mechanism, target, start)[:, mechanism.active])
    for place in path.places:
        here = point_postures(robot, place, free, seeds)
        found.append(here)
        if len(here):
            seeds = [start, *here.q[np.unique(here.same, return_index=True)[1]][:, robot.mechanism.active]]
    return found


def point_postures(robot: SpatialRobot, place: CutPlace, free: Redundancy, seeds: Sequence[Real]) -> PointPostures:
    """Postures at one point over the redundancy; see :func:`path_postures`.

    Parameters
    ----------
    seeds : (n_active,) each
        Driven joint values from which a robot without a spherical wrist is searched.
    """
    closed = not robot.mechanism.closures and has_spherical_wrist(robot.mechanism)
    rows: list[tuple[Real, float, float]] = []
    last: list[Real] = []
    for table in free.table:
        for tool in free.tool:
            target = target_of(free.place(place, float(tool), float(table)))
            if closed:
                solutions = wrist_solutions(robot.mechanism, target)
            else:
                solutions = _iterated(robot, target, [*last, *seeds[: _SEEDS - len(last)]])
                last = list(solutions[:, robot.mechanism.active])[:2]
            rows += [(q, float(tool), float(table)) for q in solutions]
    return _kept(of_point(robot, rows), free)


def reached_near(robot: SpatialRobot, place: CutPlace, near: Real) -> Real | None:
    """The posture (n_moving,) that holds the tool at ``place`` nearest to ``near``, turns of a joint included; or None.

    Parameters
    ----------
    near : (n_moving,), rad or m
        Joint values before.
    """
    target = target_of(place)
    if robot.mechanism.closures or not has_spherical_wrist(robot.mechanism):
        solutions = _iterated(robot, target, [near[robot.mechanism.active]])
    else:
        solutions = wrist_solutions(robot.mechanism, target)
    if not len(solutions):
        return None
    every = np.concatenate([with_turns(robot, q) for q in solutions])
    return np.asarray(every[np.argmin(np.abs(every - near).max(axis=1))])


def with_turns(robot: SpatialRobot, q: Real) -> Real:
    """A posture and the same with whole turns added to joints whose limits allow it, (n, n_moving)."""
    options = []
    for index, value in zip(robot.mechanism.moving, q, strict=True):
        frame = robot.mechanism.frames[index]
        limited = np.isfinite(frame.lower) and np.isfinite(frame.upper)
        turns = (0.0, 1.0, -1.0) if frame.motion == "revolute" and frame.active and limited else (0.0,)
        values = [value + 2 * np.pi * turn for turn in turns]
        options.append([v for v in values if not limited or frame.lower <= v <= frame.upper] or [value])
    grid = np.array(np.meshgrid(*options, indexing="ij"))
    return np.asarray(grid.reshape(len(options), -1).T)


def of_point(robot: SpatialRobot, rows: Sequence[tuple[Real, float, float]]) -> PointPostures:
    """Postures of one point with their margins, whole turns of joints added.

    Parameters
    ----------
    rows
        Joint values, tool angle and table angle (rad) of each posture.
    """
    n = len(robot.mechanism.moving)
    turned = [with_turns(robot, q) for q, _, _ in rows]
    same = np.repeat(np.arange(len(rows)), [len(group) for group in turned])
    q = np.concatenate([*turned, np.zeros((0, n))])
    angles = np.array([row[1:] for row in rows]).reshape(len(rows), 2)[same]
    margin = np.array([limit_margin(robot.mechanism, posture) for posture in q])
    singular = np.array([singular_values(robot.mechanism, row[0]) for row in rows]).reshape(len(rows), 2)[same]
    return PointPostures(q, angles[:, 0], angles[:, 1], margin, singular[:, 0], singular[:, 1], same)


def _kept(every: PointPostures, free: Redundancy) -> PointPostures:
    """The postures that keep the margins."""
    good = (every.margin >= free.limit_margin) & (every.smallest >= free.least_singular_value)
    return PointPostures(*(getattr(every, field.name)[good] for field in fields(every)))


def _iterated(robot: SpatialRobot, target: Real, seeds: Sequence[Real]) -> Real:
    """Different solutions within the limits from several starts, (n, n_moving)."""
    kept: list[Real] = []
    for seed in seeds:
        try:
            q = inverse_kinematics(robot.mechanism, target, seed)
        except InputError:
            continue
        new = all(np.abs(q - other).max() > _APART for other in kept)
        if new and limit_margin(robot.mechanism, q) >= 0:
            kept.append(q)
    return np.array(kept).reshape(len(kept), len(robot.mechanism.moving))
