"""Postures along a path, objectives, and values of all postures by interpolation of a few evaluations."""

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

from ...settings import PATH
from .values import PathCut, PostureRequest, PostureValues, ValueRow, of_rows, values_of

Memory = dict[tuple[int, bytes], ValueRow]  # values by point and joint values


@dataclass(frozen=True)
class Loading:
    """Force and moment of the cut in its axes at each point, (n, 6), and which deflection under weight counts."""

    wrenches: Real
    weight: str


@dataclass(frozen=True)
class PathState:
    """A sequence of postures along a path."""

    tool: Real  # (n,), rad; turn of the robot about the tool
    table: Real  # (n,), rad; turn of the rotary table
    q: Real  # (n, n_moving), rad and m; joint values; NaN where the point is not reached
    positions: Real  # (n, 3), m; tip of the tool in the base frame, after the table turned
    attitudes: Real  # (n, 3, 3); tool frame as columns, after the table turned
    axes: Real  # (n, 3, 3); axes of the cut as columns, after the table turned
    values: PostureValues  # depth limits and deflections; NaN where the point is not reached
    deviation: Real  # (n, 3), m; along the feed, across it (in the surface), along the tool
    margin: Real  # (n,), rad; distance to the nearest joint limit
    smallest: Real  # (n,); smallest singular value of the tool Jacobian
    condition: Real  # (n,); its condition number

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
) -> PostureRequest:
    """Request for one point in one posture: joint values, tool angle, table angle."""
    q, tool, table = posture
    axes = free.place(path.places[point], tool, table).axes
    return PostureRequest(q, axes, np.kron(np.eye(2), axes) @ loading.wrenches[point])


def state_of(
    cut: PathCut,
    path: CutPath,
    free: Redundancy,
    loading: Loading,
    postures: list[tuple[Real, float, float]],
    pool: Executor | None = None,
    memory: Memory | None = None,
) -> PathState:
    """Evaluate one posture for each point; NaN where it is not reached. ``memory`` holds known values of this cut."""
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
    """Find the sequence for an objective, and the front of depth and deviation for ``both``.

    ``depth``: the smallest depth limit along the path as large as possible. ``deviation``: the largest deviation as
    small as possible. ``both``: for depths between those of the two, the smallest largest deviation among postures
    that allow the depth (epsilon constraint); of these, with depth and deviation scaled to 0 ... 1 between the single
    optima, the smallest ``balance (1 - depth) + (1 - balance) deviation``.
    """
    deepest = _best([-depth for depth in costs.depth], costs)
    if objective == "depth":
        return deepest, ()
    stiffest = _best(costs.deviation, costs)
    if objective == "deviation":
        return stiffest, ()
    top, bottom = -deepest.bottleneck, _along(costs.depth, stiffest).min()
    sequences = [stiffest]
    for level in np.linspace(bottom, top, PATH.front_levels)[1:]:
        limited = [
            np.where(depth >= level * (1 - 1e-9), moved, np.inf)
            for depth, moved in zip(costs.depth, costs.deviation, strict=True)
        ]
        sequences.append(best_sequence(limited, costs.nodes, motion=PATH.motion_weight, extra=costs.turned))
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
    """Return the best sequence for a cost; accept a slightly worse worst value for less motion of the joints."""
    hard = best_sequence(values, costs.nodes)
    if not len(hard.chosen):
        raise InputError(
            f"no continuous sequence of postures leads past point {hard.reached + 1} of {len(values)}: allow larger "
            "--joint-step, less --limit-margin or more --turns, or move the path"
        )
    return best_sequence(
        values,
        costs.nodes,
        slack=PATH.bottleneck_slack * abs(hard.bottleneck),
        motion=PATH.motion_weight,
        extra=costs.turned,
    )


@dataclass(frozen=True)
class ScreenedValues:
    """Values of the distinct postures of one point."""

    depth: Real  # (n_distinct,), m; proven at an anchor, else interpolated
    cut: Real  # (n_distinct, 6), m and rad; deflection under the cut, base frame
    weight: Real  # (n_distinct, 6), m and rad; deflection under weight


def screen_postures(
    cut: PathCut,
    path: CutPath,
    free: Sequence[Redundancy],
    postures: Sequence[PointPostures],
    loading: Loading,
    pool: Executor | None,
) -> tuple[list[ScreenedValues], int]:
    """Evaluate every posture at the anchors and interpolate along the path; also the number of evaluations.

    A posture between two anchors is interpolated from the posture at each anchor with the same sampled redundancy
    angles and the nearest joint values. A posture without one is evaluated itself.
    """
    n = len(path.places)
    anchors = np.unique(np.round(np.linspace(0, n - 1, min(n, PATH.anchors))).astype(int))
    first = [_representatives(point) for point in postures]
    known: dict[int, ScreenedValues] = dict(
        zip(
            anchors.tolist(), _evaluated(cut, path, free, postures, first, loading, anchors.tolist(), pool), strict=True
        )
    )
    count = sum(len(first[k]) for k in anchors)
    values: list[ScreenedValues] = []
    missing: list[tuple[int, int]] = []
    for k in range(n):
        if k in known:
            values.append(known[k])
            continue
        place = int(np.searchsorted(anchors, k))
        low, high = int(anchors[place - 1]), int(anchors[place])
        share = (path.lengths[k] - path.lengths[low]) / max(path.lengths[high] - path.lengths[low], 1e-12)
        pairs = [
            (a, _nearest_at_anchor(postures[k], first[k], postures[a], first[a], free[k], free[a])) for a in (low, high)
        ]
        value = _interpolated(known, pairs, share)
        missing += [(k, s) for s in np.flatnonzero(np.isnan(value.depth)).tolist()]
        values.append(value)
    if missing:
        _evaluate_missing(cut, path, free, postures, first, loading, missing, values, pool)
    return values, count + len(missing)


def _representatives(postures: PointPostures) -> Index:
    """Return the index of one node of each distinct posture."""
    return np.asarray(np.unique(postures.same, return_index=True)[1], dtype=np.int64)


def distinct(postures: PointPostures) -> Index:
    """Index of each node's posture among the distinct ones, (n_nodes,)."""
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
) -> list[ScreenedValues]:
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
        ScreenedValues(
            depth[end - len(first[k]) : end], *(part[end - len(first[k]) : end] for part in (values.cut, values.weight))
        )
        for k, end in zip(points, ends, strict=True)
    ]


def _nearest_at_anchor(
    point: PointPostures,
    nodes: Index,
    anchor: PointPostures,
    anchor_nodes: Index,
    free: Redundancy,
    anchor_free: Redundancy,
) -> Index:
    """Return for each distinct posture the nearest posture with the same angles at the anchor; -1 if there is none."""
    if not len(nodes) or not len(anchor_nodes):
        return np.full(len(nodes), -1)
    keys = [_grid(point, nodes, free), _grid(anchor, anchor_nodes, anchor_free)]
    apart = point.q[nodes][:, None] - anchor.q[anchor_nodes][None]
    # a full turn of a joint does not change the dynamics
    apart = np.abs(apart - 2 * np.pi * np.round(apart / (2 * np.pi))).max(axis=2)
    apart[(keys[0][:, None] != keys[1][None]).any(axis=2)] = np.inf
    best = apart.argmin(axis=1)
    return np.asarray(np.where(apart[np.arange(len(nodes)), best] < PATH.same_branch, best, -1))


def _grid(postures: PointPostures, at: Index, free: Redundancy) -> Index:
    """Return the indices of both angles of each posture among the sampled angles, two columns."""
    tool = np.abs(postures.tool[at][:, None] - free.tool).argmin(axis=1)
    return np.column_stack([tool, np.abs(postures.table[at][:, None] - free.table).argmin(axis=1)])


def _interpolated(known: dict[int, ScreenedValues], pairs: list[tuple[int, Index]], share: float) -> ScreenedValues:
    """Interpolate linearly between the values at two anchors.

    If only one anchor has a value, return it; if no anchor has a value, return NaN.
    """
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

    return ScreenedValues(mixed("depth"), mixed("cut"), mixed("weight"))


def _evaluate_missing(
    cut: PathCut,
    path: CutPath,
    free: Sequence[Redundancy],
    postures: Sequence[PointPostures],
    first: Sequence[Index],
    loading: Loading,
    missing: list[tuple[int, int]],
    values: list[ScreenedValues],
    pool: Executor | None,
) -> None:
    """Evaluate the postures that have no near posture at an anchor, and write the results into ``values``."""
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
