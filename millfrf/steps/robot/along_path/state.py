"""States along a path, objectives, and values of all postures from a few evaluations."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Index, InputError, Real
from millfrf.robot_model import (
    CutPath,
    PointPostures,
    PostureSequence,
    Redundancy,
    SpatialRobot,
    best_sequence,
    counted_weight,
    limit_margin,
    singular_values,
)

from .values import PathCut, PostureValues, Request, ValueRow, of_rows, values_of

Memory = dict[tuple[int, bytes], ValueRow]
"""Values by point and joint values."""


@dataclass(frozen=True)
class Loading:
    """Force and moment of the cut in the axes of the cut at each point, (n, 6), and which weight counts."""

    wrenches: Real
    weight: str


@dataclass(frozen=True)
class PathState:
    """A sequence of postures along a path.

    Parameters
    ----------
    tool, table : (n,), rad
        Turn of the robot about the tool and turn of the rotary table.
    q : (n, n_moving), rad and m
        Joint values; NaN where the point is not reached.
    positions : (n, 3), m
        Tip of the tool in the base frame, after the table turned.
    attitudes, axes : (n, 3, 3)
        Tool frame and axes of the cut as columns, likewise.
    values
        Depth limits and deflections; NaN where the point is not reached.
    deviation : (n, 3), m
        Deviation that the part sees: along the feed, across it (in the surface), along the tool.
    margin : (n,), rad
        Distance to the nearest joint limit.
    smallest, condition : (n,)
        Smallest singular value and condition number of the tool Jacobian.
    """

    tool: Real
    table: Real
    q: Real
    positions: Real
    attitudes: Real
    axes: Real
    values: PostureValues
    deviation: Real
    margin: Real
    smallest: Real
    condition: Real

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether each point is reached."""
        return np.asarray(~np.isnan(self.q).any(axis=1))

    @property
    def sizes(self) -> Real:
        """Length of the deviation, m, (n,)."""
        return np.asarray(np.linalg.norm(self.deviation, axis=1))


def request_at(
    path: CutPath, free: Redundancy, loading: Loading, point: int, posture: tuple[Real, float, float]
) -> Request:
    """Request of one point in one posture: joint values, tool angle, table angle."""
    q, tool, table = posture
    axes = free.place(path.places[point], tool, table).axes
    return Request(q, axes, np.kron(np.eye(2), axes) @ loading.wrenches[point])


def state_of(
    cut: PathCut,
    path: CutPath,
    free: Redundancy,
    loading: Loading,
    postures: list[tuple[Real, float, float]],
    pool: Executor | None = None,
    memory: Memory | None = None,
) -> PathState:
    """Evaluate one posture for each point; rows of NaN where it is not reached.

    Values that ``memory`` holds of the same cut are not computed again; new ones are added to it.
    """
    memory = {} if memory is None else memory
    reached = np.array([not np.isnan(q).any() for q, _, _ in postures])
    keys = {int(i): (int(i), np.round(postures[i][0], 9).tobytes()) for i in np.flatnonzero(reached)}
    new = [i for i, key in keys.items() if key not in memory]
    fresh = values_of(cut, [request_at(path, free, loading, i, postures[i]) for i in new], pool)
    memory.update({keys[i]: row for i, row in zip(new, fresh.rows(), strict=True)})
    values = of_rows([memory[key] for key in keys.values()]).over(reached)
    places = [free.place(p, tool, table) for p, (_, tool, table) in zip(path.places, postures, strict=True)]
    axes = np.array([place.axes for place in places])
    moved = values.cut + counted_weight(values.weight, loading.weight)
    deviation = np.einsum("kji,kj->ki", axes, moved[:, :3])
    q = np.array([posture[0] for posture in postures])
    margins = np.array([_margins(cut.robot, posture) for posture in q])
    return PathState(
        np.array([posture[1] for posture in postures]),
        np.array([posture[2] for posture in postures]),
        q,
        np.array([place.position for place in places]),
        np.array([place.attitude for place in places]),
        axes,
        values,
        deviation,
        *margins.T,
    )


def _margins(robot: SpatialRobot, q: Real) -> tuple[float, float, float]:
    if np.isnan(q).any():
        return np.nan, np.nan, np.nan
    return limit_margin(robot.mechanism, q), *singular_values(robot.mechanism, q)


Objective = Literal["depth", "deviation", "both"]

LEVELS = 9
"""Depths of the front between the two single optima."""

_SLACK = 0.02
"""Share of the bottleneck that may be given up for less motion."""

_MOTION = 0.1
"""Weight of squared steps against the cost of a node."""


@dataclass(frozen=True)
class Costs:
    """Depth and deviation (m), joint values over the largest steps, and squared turns of the nodes of each point."""

    depth: Sequence[Real]
    deviation: Sequence[Real]
    nodes: Sequence[Real]
    turned: Sequence[Real]


@dataclass(frozen=True)
class FrontPoint:
    """Smallest depth (m) and largest deviation (m) along one sequence of the front, by the screening's values."""

    depth: float
    deviation: float


def chosen_sequence(
    costs: Costs, objective: Objective, balance: float
) -> tuple[PostureSequence, tuple[FrontPoint, ...]]:
    """Find the sequence for an objective, and the front where both count.

    ``depth``: the smallest depth limit along the path as large as possible. ``deviation``: the largest deviation as
    small as possible. ``both``: for depths between those of the two, the smallest largest deviation among postures
    that allow the depth (epsilon constraint); of these, with depth and deviation scaled to 0 ... 1 between the single
    optima, the smallest ``balance (1 - depth) + (1 - balance) deviation``.

    Raises
    ------
    InputError
        No continuous sequence exists.
    """
    deepest = _best([-depth for depth in costs.depth], costs)
    if objective == "depth":
        return deepest, ()
    stiffest = _best(costs.deviation, costs)
    if objective == "deviation":
        return stiffest, ()
    top, bottom = -deepest.bottleneck, _along(costs.depth, stiffest).min()
    sequences = [stiffest]
    for level in np.linspace(bottom, top, LEVELS)[1:]:
        limited = [
            np.where(depth >= level * (1 - 1e-9), moved, np.inf)
            for depth, moved in zip(costs.depth, costs.deviation, strict=True)
        ]
        sequences.append(best_sequence(limited, costs.nodes, motion=_MOTION, extra=costs.turned))
    sequences = [sequence for sequence in sequences if len(sequence.chosen)]
    front = tuple(
        FrontPoint(float(_along(costs.depth, sequence).min()), float(_along(costs.deviation, sequence).max()))
        for sequence in sequences
    )
    return sequences[_balanced(front, balance)], tuple(dict.fromkeys(front))


def _balanced(front: Sequence[FrontPoint], balance: float) -> int:
    depth, moved = np.array([point.depth for point in front]), np.array([point.deviation for point in front])
    score = balance * (1 - _scaled(depth)) + (1 - balance) * _scaled(moved)
    return int(np.argmin(score))


def _scaled(values: Real) -> Real:
    width = float(np.ptp(values))
    return np.asarray((values - values.min()) / width) if width > 0 else np.zeros_like(values)


def _along(values: Sequence[Real], sequence: PostureSequence) -> Real:
    return np.array([float(column[i]) for column, i in zip(values, sequence.chosen, strict=True)])


def _best(values: Sequence[Real], costs: Costs) -> PostureSequence:
    """Best sequence for a cost; a little of the bottleneck is given up for less motion of the joints."""
    hard = best_sequence(values, costs.nodes)
    if not len(hard.chosen):
        raise InputError(
            f"no continuous sequence of postures leads past point {hard.reached + 1} of {len(values)}: allow larger "
            "--joint-step, less --limit-margin or more --turns, or move the path"
        )
    return best_sequence(values, costs.nodes, slack=_SLACK * abs(hard.bottleneck), motion=_MOTION, extra=costs.turned)


ANCHORS = 17
"""Points of a path at which every posture is evaluated; between them values are interpolated."""

_NEAR = 0.8
"""Joint difference within which a posture at an anchor stands for one between anchors, rad."""


@dataclass(frozen=True)
class Screened:
    """Values of the distinct postures of one point.

    Parameters
    ----------
    depth : (n_distinct,), m
        Depth that is proven at an anchor, or interpolated.
    cut, weight : (n_distinct, 6), m and rad
        Deflections, base frame.
    """

    depth: Real
    cut: Real
    weight: Real


def screened(
    cut: PathCut,
    path: CutPath,
    free: Sequence[Redundancy],
    postures: Sequence[PointPostures],
    loading: Loading,
    pool: Executor | None,
) -> tuple[list[Screened], int]:
    """Evaluate every posture at the anchors, interpolate between them along the way; and how many were evaluated.

    A posture between two anchors takes the values of the posture at each anchor that has the same place among the
    sampled redundancy angles and the nearest joint values. One that has none is evaluated itself.
    """
    n = len(path.places)
    anchors = np.unique(np.round(np.linspace(0, n - 1, min(n, ANCHORS))).astype(int))
    first = [_first(point) for point in postures]
    known: dict[int, Screened] = dict(
        zip(
            anchors.tolist(), _evaluated(cut, path, free, postures, first, loading, anchors.tolist(), pool), strict=True
        )
    )
    count = sum(len(first[k]) for k in anchors)
    values: list[Screened] = []
    missing: list[tuple[int, int]] = []
    for k in range(n):
        if k in known:
            values.append(known[k])
            continue
        place = int(np.searchsorted(anchors, k))
        low, high = int(anchors[place - 1]), int(anchors[place])
        share = (path.lengths[k] - path.lengths[low]) / max(path.lengths[high] - path.lengths[low], 1e-12)
        pairs = [(a, _partner(postures[k], first[k], postures[a], first[a], free[k], free[a])) for a in (low, high)]
        value = _between(known, pairs, share)
        missing += [(k, s) for s in np.flatnonzero(np.isnan(value.depth)).tolist()]
        values.append(value)
    if missing:
        _fill(cut, path, free, postures, first, loading, missing, values, pool)
    return values, count + len(missing)


def _first(postures: PointPostures) -> Index:
    """Index of one node of each distinct posture; distinct postures are renumbered by their order."""
    return np.asarray(np.unique(postures.same, return_index=True)[1], dtype=np.int64)


def distinct(postures: PointPostures) -> Index:
    """Place of each node's posture among the distinct ones, (n_nodes,)."""
    return np.asarray(np.unique(postures.same, return_inverse=True)[1], dtype=np.int64)


def _evaluated(
    cut: PathCut,
    path: CutPath,
    free: Sequence[Redundancy],
    postures: Sequence[PointPostures],
    first: Sequence[Index],
    loading: Loading,
    points: list[int],
    pool: Executor | None,
) -> list[Screened]:
    requests = [
        request_at(
            path, free[k], loading, k, (postures[k].q[s], float(postures[k].tool[s]), float(postures[k].table[s]))
        )
        for k in points
        for s in first[k]
    ]
    values = values_of(cut, requests, pool)
    depth, ends = values.known_depth(cut.max_depth), np.cumsum([len(first[k]) for k in points])
    return [
        Screened(
            depth[end - len(first[k]) : end], *(part[end - len(first[k]) : end] for part in (values.cut, values.weight))
        )
        for k, end in zip(points, ends, strict=True)
    ]


def _partner(
    here: PointPostures, mine: Index, there: PointPostures, theirs: Index, free: Redundancy, other: Redundancy
) -> Index:
    """For each distinct posture the nearest one at the other point with the same angles; -1 where none is near."""
    if not len(mine) or not len(theirs):
        return np.full(len(mine), -1)
    keys = [_grid(point, at, angles) for point, at, angles in ((here, mine, free), (there, theirs, other))]
    apart = here.q[mine][:, None] - there.q[theirs][None]
    apart = np.abs(apart - 2 * np.pi * np.round(apart / (2 * np.pi))).max(axis=2)
    apart[(keys[0][:, None] != keys[1][None]).any(axis=2)] = np.inf
    best = apart.argmin(axis=1)
    return np.asarray(np.where(apart[np.arange(len(mine)), best] < _NEAR, best, -1))


def _grid(postures: PointPostures, at: Index, free: Redundancy) -> Index:
    """Places of the postures' angles among the sampled ones, (n, 2)."""
    tool = np.abs(postures.tool[at][:, None] - free.tool).argmin(axis=1)
    return np.column_stack([tool, np.abs(postures.table[at][:, None] - free.table).argmin(axis=1)])


def _between(known: dict[int, Screened], pairs: list[tuple[int, Index]], share: float) -> Screened:
    """Linear between two anchors; of one anchor where the other has no partner, NaN where neither has."""
    (low, left), (high, right) = pairs
    weights = np.column_stack([np.where(left >= 0, 1 - share, 0.0), np.where(right >= 0, share, 0.0)])
    weights[(left >= 0) & (right < 0), 0] = 1.0
    weights[(left < 0) & (right >= 0), 1] = 1.0
    with np.errstate(invalid="ignore", divide="ignore"):
        weights = weights / weights.sum(axis=1, keepdims=True)

    def mixed(name: str) -> Real:
        columns = []
        for anchor, partner in ((low, left), (high, right)):
            column = getattr(known[anchor], name)
            columns.append(column[partner] if len(column) else np.zeros((len(partner), *column.shape[1:])))
        shape = (-1,) + (1,) * (columns[0].ndim - 1)
        return np.asarray(weights[:, 0].reshape(shape) * columns[0] + weights[:, 1].reshape(shape) * columns[1])

    return Screened(mixed("depth"), mixed("cut"), mixed("weight"))


def _fill(
    cut: PathCut,
    path: CutPath,
    free: Sequence[Redundancy],
    postures: Sequence[PointPostures],
    first: Sequence[Index],
    loading: Loading,
    missing: list[tuple[int, int]],
    values: list[Screened],
    pool: Executor | None,
) -> None:
    """Evaluate the postures that no anchor stands for, into ``values``."""
    requests = []
    for k, s in missing:
        node = first[k][s]
        posture = (postures[k].q[node], float(postures[k].tool[node]), float(postures[k].table[node]))
        requests.append(request_at(path, free[k], loading, k, posture))
    evaluated = values_of(cut, requests, pool)
    depth = evaluated.known_depth(cut.max_depth)
    for row, (k, s) in enumerate(missing):
        values[k].depth[s], values[k].cut[s], values[k].weight[s] = (
            depth[row],
            evaluated.cut[row],
            evaluated.weight[row],
        )
