"""Postures that hold the tool along a path, and the best continuous sequence of them."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Index, InputError, Real

from ..kinematics.inverse import inverse_kinematics, tool_postures
from ..kinematics.mechanism import Mechanism, tool_jacobian
from ..kinematics.spherical_wrist import has_spherical_wrist, wrist_solutions
from ..machining.redundancy import CutPlace, target_of, turned_place
from ..spatial.spatial_robot import SpatialRobot, structure_at
from ..spatial.weight import Payload, payload_wrench, static_response, tool_attitude
from .cut_path import CutPath, RotaryTable


@dataclass(frozen=True)
class PostureSequence:
    """Result of the search.

    Parameters
    ----------
    chosen : (n_points,)
        Index of the node chosen at each point; empty where no continuous sequence exists.
    bottleneck
        Largest cost along the sequence; infinite where there is none.
    reached
        Number of points up to which a continuous sequence exists.
    """

    chosen: Index
    bottleneck: float
    reached: int


def best_sequence(
    costs: Sequence[Real], nodes: Sequence[Real], *, slack: float = 0.0, motion: float = 1.0, extra: Sequence[Real] = ()
) -> PostureSequence:
    """Find the sequence of one node a point with the smallest largest cost whose steps are all at most 1.

    Dynamic programming twice. First ``V_k(j) = max(c_k(j), min_i V_k-1(i))`` over the nodes i that one step reaches:
    exact for the largest cost. Then, over the nodes whose cost is at most that bottleneck (plus ``slack``), the
    smallest ``sum (c / C + extra) + motion sum |step|^2``, with C the bottleneck or, where it is zero, one.

    Parameters
    ----------
    costs : (n_k,) each
        Cost of each node of a point; infinite where it must not be used.
    nodes : (n_k, n_joints) each
        Joint values over the largest step of each joint: two nodes are joined where no coordinate differs by over 1.
    slack
        Cost above the bottleneck that the second search may use, for less motion.
    motion
        Weight of the squared steps.
    extra : (n_k,) each
        Added to each node's share in the second search alone: what is preferred among equals.

    Examples
    --------
    >>> costs = [np.array([1.0, 0.0]), np.array([0.0, 5.0]), np.array([2.0, 0.0])]
    >>> nodes = [np.array([[0.0], [3.0]])] * 3
    >>> best_sequence(costs, nodes).chosen.tolist(), best_sequence(costs, nodes).bottleneck
    ([0, 0, 0], 2.0)
    """
    steps = [_edges(first, second) for first, second in pairwise(nodes)]
    values = costs[0]
    for k, (first, second) in enumerate(steps):
        if not np.isfinite(values).any():
            return PostureSequence(np.zeros(0, dtype=np.int64), np.inf, k)
        least = np.full(len(costs[k + 1]), np.inf)
        np.minimum.at(least, second, values[first])
        values = np.maximum(costs[k + 1], least)
    bottleneck = float(values.min(initial=np.inf))
    if not np.isfinite(bottleneck):
        return PostureSequence(np.zeros(0, dtype=np.int64), np.inf, len(costs) - 1)
    scale = abs(bottleneck) or 1.0
    added = extra or [np.zeros(len(cost)) for cost in costs]
    shares = [
        np.where(cost <= bottleneck + slack, cost / scale + more, np.inf)
        for cost, more in zip(costs, added, strict=True)
    ]
    return PostureSequence(_shortest(shares, nodes, steps, motion), bottleneck, len(costs))


def _shortest(
    shares: Sequence[Real], nodes: Sequence[Real], steps: Sequence[tuple[Index, Index]], motion: float
) -> Index:
    """Smallest sum of shares and squared steps; a share is infinite where a node is not allowed."""
    values = shares[0]
    back: list[Index] = []
    for k, (first, second) in enumerate(steps):
        way = values[first] + motion * np.sum((nodes[k][first] - nodes[k + 1][second]) ** 2, axis=1)
        order = np.lexsort([way, second])
        where, place = np.unique(second[order], return_index=True)
        previous = np.full(len(nodes[k + 1]), -1)
        least = np.full(len(nodes[k + 1]), np.inf)
        previous[where], least[where] = first[order][place], way[order][place]
        back.append(previous)
        values = least + shares[k + 1]
    chosen = [int(np.argmin(values))]
    for previous in reversed(back):
        chosen.append(int(previous[chosen[-1]]))
    return np.array(chosen[::-1], dtype=np.int64)


def _edges(first: Real, second: Real) -> tuple[Index, Index]:
    """Pairs of nodes whose coordinates all differ by at most 1."""
    if not len(first) or not len(second):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    near = scipy.spatial.cKDTree(first).sparse_distance_matrix(
        scipy.spatial.cKDTree(second), 1.0 + 1e-9, p=np.inf, output_type="ndarray"
    )
    return near["i"].astype(np.int64), near["j"].astype(np.int64)


def limit_margin(mechanism: Mechanism, q: Real) -> float:
    """Distance to the nearest joint limit, rad (prismatic joints: m); infinite without limits, negative beyond one."""
    frames = [mechanism.frames[index] for index in mechanism.moving]
    return float(min(min(value - f.lower, f.upper - value) for f, value in zip(frames, q, strict=True)))


def singular_values(mechanism: Mechanism, q: Real) -> tuple[float, float]:
    """Smallest singular value of the tool Jacobian (m, rad) and its condition number.

    Rows count as they are, m and rad: translations and rotations weigh alike at an arm of 1 m. At a singularity the
    smallest value is zero: no joint motion moves the tool in one direction.
    """
    values = np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)
    return float(values[-1]), float(values[0] / max(values[-1], 1e-300))


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


def tool_deflection(robot: SpatialRobot, q: Real, wrench: Real, payload: Payload) -> tuple[Real, Real]:
    """Give what the cut moves the tool by, and what weight does, each (6,), m and rad, base frame.

    ``delta = C W`` and ``C W_payload + sag`` with the static compliance C of the whole structure. Where the file gives
    no masses, own weight is left out.

    Parameters
    ----------
    robot
        Robot with its structure.
    q : (n_moving,), rad or m
        Joint values of the posture.
    wrench : (6,), N and N m
        Force and moment on the tool, base frame.
    payload
        Load besides the bodies of the file.
    """
    static = static_response(robot, structure_at(robot, q))
    weight = static.compliance @ payload_wrench(robot, tool_attitude(robot.mechanism, q), payload)
    if static.own_weight is not None:
        weight = weight + static.own_weight
    return np.asarray(static.compliance @ wrench), np.asarray(weight)
