"""Values of all postures of a path from evaluations at a few of its points."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.robot_model import CutPath, PointPostures, Redundancy

from .path_state import Loading, request_at
from .posture_values import PathCut, values_of

Real = NDArray[np.float64]
Index = NDArray[np.int64]

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
    first = [_first(one) for one in postures]
    known: dict[int, Screened] = dict(
        zip(
            anchors.tolist(), _evaluated(cut, path, free, postures, first, loading, anchors.tolist(), pool), strict=True
        )
    )
    count = sum(len(first[k]) for k in anchors)
    found: list[Screened] = []
    missing: list[tuple[int, int]] = []
    for k in range(n):
        if k in known:
            found.append(known[k])
            continue
        place = int(np.searchsorted(anchors, k))
        low, high = int(anchors[place - 1]), int(anchors[place])
        share = (path.lengths[k] - path.lengths[low]) / max(path.lengths[high] - path.lengths[low], 1e-12)
        pairs = [(a, _partner(postures[k], first[k], postures[a], first[a], free[k], free[a])) for a in (low, high)]
        value = _between(known, pairs, share)
        missing += [(k, s) for s in np.flatnonzero(np.isnan(value.depth)).tolist()]
        found.append(value)
    if missing:
        _fill(cut, path, free, postures, first, loading, missing, found, pool)
    return found, count + len(missing)


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
    keys = [_grid(one, at, angles) for one, at, angles in ((here, mine, free), (there, theirs, other))]
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
    """Linear between two anchors; one alone where the other has no partner, NaN where neither has."""
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
    found: list[Screened],
    pool: Executor | None,
) -> None:
    """Evaluate the postures that no anchor stands for, into ``found``."""
    requests = []
    for k, s in missing:
        node = first[k][s]
        posture = (postures[k].q[node], float(postures[k].tool[node]), float(postures[k].table[node]))
        requests.append(request_at(path, free[k], loading, k, posture))
    values = values_of(cut, requests, pool)
    depth = values.known_depth(cut.max_depth)
    for row, (k, s) in enumerate(missing):
        found[k].depth[s], found[k].cut[s], found[k].weight[s] = depth[row], values.cut[row], values.weight[row]
