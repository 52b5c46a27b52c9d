"""Postures that hold the tool along a path, and the best continuous sequence of them."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Index, InputError, Real

from ..kinematics.inverse import has_spherical_wrist, inverse_kinematics, tool_postures, wrist_solutions
from ..kinematics.mechanism import Mechanism, tool_jacobian
from ..settings import ROBOT
from ..spatial.spatial_robot import SpatialRobot
from .cut_path import CutPath, CutPlace, RotaryTable, target_of, turned_place


@dataclass(frozen=True)
class PostureSequence:
    """Result of the search for the best sequence.

    Parameters
    ----------
    chosen : (n_points,)
        Index of the chosen node at each point; empty if there is no continuous sequence.
    bottleneck
        Largest cost along the sequence; infinite if there is none.
    reached
        Number of points up to which a continuous sequence exists.
    """

    chosen: Index
    bottleneck: float
    reached: int


def best_sequence(
    costs: Sequence[Real], nodes: Sequence[Real], *, slack: float = 0.0, motion: float = 1.0, extra: Sequence[Real] = ()
) -> PostureSequence:
    """Find a sequence of one node per point whose largest cost is as small as possible, with all steps at most 1.

    Dynamic programming is used twice. The first pass minimises the largest cost, the bottleneck:
    ``V_k(j) = max(c_k(j), min_i V_k-1(i))`` over the nodes i from which one step leads to node j. The second pass uses
    the nodes with costs up to the bottleneck (plus ``slack``) and minimises
    ``sum (c / C + extra) + motion sum |step|^2``, with C the bottleneck, or 1 if the bottleneck is zero.

    Parameters
    ----------
    costs : (n_k,) each
        Cost of each node of a point; infinite if the node must not be used.
    nodes : (n_k, n_joints) each
        Joint values over the largest step of each joint: two nodes are connected if no coordinate differs by over 1.
    slack
        Cost above the bottleneck that the second search may use, for less motion.
    motion
        Weight of the squared steps.
    extra : (n_k,) each
        Added to the cost of each node in the second search only: a preference among equal nodes.

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
    preferences = extra or [np.zeros(len(cost)) for cost in costs]
    summands = [
        np.where(cost <= bottleneck + slack, cost / scale + preference, np.inf)
        for cost, preference in zip(costs, preferences, strict=True)
    ]
    return PostureSequence(_shortest(summands, nodes, steps, motion), bottleneck, len(costs))


def _shortest(
    summands: Sequence[Real], nodes: Sequence[Real], steps: Sequence[tuple[Index, Index]], motion: float
) -> Index:
    """Find the nodes with the smallest sum of summands and squared steps; a forbidden node has an infinite summand."""
    values = summands[0]
    predecessors: list[Index] = []
    for k, (first, second) in enumerate(steps):
        totals = values[first] + motion * np.sum((nodes[k][first] - nodes[k + 1][second]) ** 2, axis=1)
        # sorted by node and then by total, so that the first entry of each node is its best
        order = np.lexsort([totals, second])
        reached, best = np.unique(second[order], return_index=True)
        predecessor = np.full(len(nodes[k + 1]), -1)
        least = np.full(len(nodes[k + 1]), np.inf)
        predecessor[reached], least[reached] = first[order][best], totals[order][best]
        predecessors.append(predecessor)
        values = least + summands[k + 1]
    chosen = [int(np.argmin(values))]
    for predecessor in reversed(predecessors):
        chosen.append(int(predecessor[chosen[-1]]))
    return np.array(chosen[::-1], dtype=np.int64)


def _edges(first: Real, second: Real) -> tuple[Index, Index]:
    """Find all pairs of nodes whose coordinates all differ by at most 1."""
    if not len(first) or not len(second):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    near = scipy.spatial.cKDTree(first).sparse_distance_matrix(
        scipy.spatial.cKDTree(second), 1.0 + 1e-9, p=np.inf, output_type="ndarray"
    )
    return near["i"].astype(np.int64), near["j"].astype(np.int64)


def limit_margin(mechanism: Mechanism, q: Real) -> float:
    """Compute the distance to the nearest joint limit, rad or m; infinite without limits, negative beyond a limit."""
    return float(min(min(value - f.lower, f.upper - value) for f, value in zip(mechanism.joints, q, strict=True)))


def singular_values(mechanism: Mechanism, q: Real) -> tuple[float, float]:
    """Compute the smallest singular value and the condition number of the tool Jacobian (m, rad).

    Rows are not scaled: translations in m and rotations in rad have equal weight, as at an arm of 1 m. At a singularity
    the smallest value is zero: no joint motion moves the tool in one direction.
    """
    values = np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)
    return float(values[-1]), float(values[0] / max(values[-1], 1e-300))


@dataclass(frozen=True)
class Redundancy:
    """Angles over which postures are sampled, and margins that a posture must have.

    Parameters
    ----------
    tool : (n_tool,), rad
        Rotations of the robot about the tool's axis.
    table : (n_table,), rad
        Rotations of the rotary table; only zero if there is none.
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
        """Return a place of the path after rotation of tool and table by angles in rad."""
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
        Number of the position of all links: postures that differ by whole turns of joints have the same number.
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
    """Compute all postures at every point of a path, over the sampled redundancy.

    A robot with a spherical wrist has every branch in closed form. Other robots have the branches that the
    Levenberg-Marquardt method reaches from ``start``, from the neighbouring angle and from the point before.

    Parameters
    ----------
    robot
        Robot whose joints hold the tool.
    path
        Places of the tool.
    free
        Redundancy angles and least margins.
    start : (n_active,), rad or m
        Driven joint values from which the search begins.

    Returns
    -------
    list
        One entry for each point, without postures if the point is not reached.
    """
    points: list[PointPostures] = []
    mechanism, seeds = robot.mechanism, [start]
    if not mechanism.closures and not has_spherical_wrist(mechanism):
        target = target_of(free.place(path.places[0], float(free.tool[0]), float(free.table[0])))
        seeds += list(tool_postures(mechanism, target, start)[:, mechanism.active])
    for place in path.places:
        postures = point_postures(robot, place, free, seeds)
        points.append(postures)
        if len(postures):
            different = np.unique(postures.same, return_index=True)[1]
            seeds = [start, *postures.q[different][:, mechanism.active]]
    return points


def point_postures(robot: SpatialRobot, place: CutPlace, free: Redundancy, seeds: Sequence[Real]) -> PointPostures:
    """Compute the postures at one point over the redundancy; see :func:`path_postures`.

    ``seeds``, (n_active,) each, are driven joint values from which a robot without a spherical wrist is searched.
    """
    closed_form = not robot.mechanism.closures and has_spherical_wrist(robot.mechanism)
    rows: list[tuple[Real, float, float]] = []
    last: list[Real] = []
    for table in free.table:
        for tool in free.tool:
            target = target_of(free.place(place, float(tool), float(table)))
            if closed_form:
                solutions = wrist_solutions(robot.mechanism, target)
            else:
                starts = [*last, *seeds[: ROBOT.path_starts - len(last)]]
                solutions = _iterated(robot.mechanism, target, starts)
                last = list(solutions[:, robot.mechanism.active])[:2]
            rows += [(q, float(tool), float(table)) for q in solutions]
    postures = _point_postures(robot.mechanism, rows)
    allowed = (postures.margin >= free.limit_margin) & (postures.smallest >= free.least_singular_value)
    return PointPostures(*(getattr(postures, field.name)[allowed] for field in fields(postures)))


def reached_near(robot: SpatialRobot, place: CutPlace, near: Real) -> Real | None:
    """Find the posture at ``place`` that is nearest to ``near``, with whole turns of joints; None: not reached.

    Both are (n_moving,), rad or m.
    """
    target, mechanism = target_of(place), robot.mechanism
    if mechanism.closures or not has_spherical_wrist(mechanism):
        solutions = _iterated(mechanism, target, [near[mechanism.active]])
    else:
        solutions = wrist_solutions(mechanism, target)
    if not len(solutions):
        return None
    candidates = np.concatenate([_with_turns(mechanism, q) for q in solutions])
    return np.asarray(candidates[np.argmin(np.abs(candidates - near).max(axis=1))])


def _with_turns(mechanism: Mechanism, q: Real) -> Real:
    """List a posture in all forms that differ by whole turns of joints within the joint limits, (n, n_moving)."""
    options = []
    for frame, value in zip(mechanism.joints, q, strict=True):
        limited = np.isfinite(frame.lower) and np.isfinite(frame.upper)
        turns = (0.0, 1.0, -1.0) if frame.motion == "revolute" and frame.active and limited else (0.0,)
        values = [value + 2 * np.pi * turn for turn in turns]
        options.append([v for v in values if not limited or frame.lower <= v <= frame.upper] or [value])
    grid = np.array(np.meshgrid(*options, indexing="ij"))
    return np.asarray(grid.reshape(len(options), -1).T)


def _point_postures(mechanism: Mechanism, rows: Sequence[tuple[Real, float, float]]) -> PointPostures:
    """Collect rows of joint values, tool angle and table angle (rad), with all whole turns, and compute margins."""
    turned = [_with_turns(mechanism, q) for q, _, _ in rows]
    same = np.repeat(np.arange(len(rows)), [len(group) for group in turned])
    q = np.concatenate([*turned, np.zeros((0, len(mechanism.moving)))])
    angles = np.array([row[1:] for row in rows]).reshape(len(rows), 2)[same]
    margin = np.array([limit_margin(mechanism, posture) for posture in q])
    singular = np.array([singular_values(mechanism, row[0]) for row in rows]).reshape(len(rows), 2)[same]
    return PointPostures(q, angles[:, 0], angles[:, 1], margin, singular[:, 0], singular[:, 1], same)


def _iterated(mechanism: Mechanism, target: Real, starts: Sequence[Real]) -> Real:
    """Find the different solutions within the limits at which the search ends from several starts, (n, n_moving)."""
    solutions: list[Real] = []
    for start in starts:
        try:
            q = inverse_kinematics(mechanism, target, start)
        except InputError:  # not reached from this start
            continue
        new = all(np.abs(q - other).max() > ROBOT.path_same_posture for other in solutions)
        if new and limit_margin(mechanism, q) >= 0:
            solutions.append(q)
    return np.array(solutions).reshape(len(solutions), len(mechanism.moving))
