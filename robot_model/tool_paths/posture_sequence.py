"""The best continuous sequence of postures along a path: the largest cost as small as it can be, then little motion."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

Real = NDArray[np.float64]
Index = NDArray[np.int64]


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
    near = cKDTree(first).sparse_distance_matrix(cKDTree(second), 1.0 + 1e-9, p=np.inf, output_type="ndarray")
    return near["i"].astype(np.int64), near["j"].astype(np.int64)
