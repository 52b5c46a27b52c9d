"""Modes over poses: paired between neighbouring poses, along a tree, and checked on the other neighbours."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import minimum_spanning_tree

from .one_mode import SeenMode
from .pairing import ALONE, Pairing, pair_modes

Real = NDArray[np.float64]

FREQUENCY_SCALE = (0.03, 0.1)
"""Difference of the logarithms of frequency that weighs one: in one posture, and what a radian (or metre) adds."""

UNKNOWN_SCALE = 0.1
"""The same where a posture is not known."""

NEIGHBOURS = 3
"""Nearest poses with which a pose's identities are checked."""

Node = tuple[int, int]
"""Number of a pose, and number of the mode in it."""


def families(
    poses: Sequence[Sequence[SeenMode]], postures: Sequence[tuple[float, ...] | None]
) -> tuple[list[list[Node]], dict[Node, str]]:
    """Modes of all poses that are the same, and doubts about single ones.

    Parameters
    ----------
    poses
        Mean modes of each pose.
    postures : (n_active,), rad or m
        Joint values of each pose, or None. Where they are known the nearest poses are neighbours; else the poses whose
        modes are most alike.

    Returns
    -------
    list of list of (int, int)
        Number of the pose and of its mode, a list for each mode of the campaign.
    dict
        Why a mode may belong to another family; what is not in it is not doubted.
    """
    distance, scales = _distances(poses, postures)
    parent = {(p, i): (p, i) for p, modes in enumerate(poses) for i in range(len(modes))}
    doubts: dict[Node, str] = {}
    tree = np.argwhere(minimum_spanning_tree(distance).toarray() > 0) if len(poses) > 1 else np.zeros((0, 2), int)
    for p, q in sorted((int(a), int(b)) for a, b in tree):
        for pair in pair_modes(poses[p], poses[q], float(scales[p, q])):
            _join(parent, (p, pair.first), (q, pair.second))
            if pair.doubt:
                doubts.setdefault((q, pair.second), f"towards the neighbouring pose: {pair.doubt}")
    for p, q, pair in _checks(poses, distance, scales):
        ends = (p, pair.first), (q, pair.second)
        if not pair.doubt and _root(parent, ends[0]) != _root(parent, ends[1]):
            for end in ends:
                doubts.setdefault(end, "two neighbouring poses disagree which mode it is")
    grouped: dict[Node, list[Node]] = {}
    for node in parent:
        grouped.setdefault(_root(parent, node), []).append(node)
    return [sorted(group) for group in grouped.values()], doubts


def _distances(poses: Sequence[Sequence[SeenMode]], postures: Sequence[tuple[float, ...] | None]) -> tuple[Real, Real]:
    """How far poses are from each other, never zero, and the scale of frequency between each two."""
    n = len(poses)
    distance, scales = np.zeros((n, n)), np.full((n, n), UNKNOWN_SCALE)
    for p in range(n):
        for q in range(p):
            a, b = postures[p], postures[q]
            if a is not None and b is not None and len(a) == len(b):
                far = float(np.linalg.norm(np.subtract(a, b)))
                scales[p, q] = scales[q, p] = FREQUENCY_SCALE[0] + FREQUENCY_SCALE[1] * min(far, 1.0)
                distance[p, q] = distance[q, p] = 1e-6 + far
            else:
                distance[p, q] = distance[q, p] = 100.0 + _unlike(poses[p], poses[q])
    return distance, scales


def _unlike(first: Sequence[SeenMode], second: Sequence[SeenMode]) -> float:
    """Share of the modes without a partner, and how far the pairs are apart in frequency."""
    pairs = pair_modes(first, second, UNKNOWN_SCALE)
    apart = [abs(first[one.first].log_frequency - second[one.second].log_frequency) for one in pairs]
    most = max(len(first), len(second), 1)
    return float(sum(apart) + ALONE * UNKNOWN_SCALE * (most - len(pairs))) / most


def _checks(poses: Sequence[Sequence[SeenMode]], distance: Real, scales: Real) -> list[tuple[int, int, Pairing]]:
    """Pairs between each pose and its nearest ones."""
    found = []
    for p in range(len(poses)):
        nearest = [int(q) for q in np.argsort(distance[p], kind="stable") if q != p][:NEIGHBOURS]
        for q in nearest:
            found += [(p, q, pair) for pair in pair_modes(poses[p], poses[q], float(scales[p, q]))]
    return found


def _root(parent: dict[Node, Node], node: Node) -> Node:
    while parent[node] != node:
        node = parent[node]
    return node


def _join(parent: dict[Node, Node], first: Node, second: Node) -> None:
    a, b = _root(parent, first), _root(parent, second)
    if a != b:
        parent[max(a, b)] = min(a, b)
