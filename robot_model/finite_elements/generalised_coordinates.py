"""Coordinates that satisfy rigid links and rigid joint directions: a small basis instead of multipliers."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from .structure import Spring, Structure, rigid_motion, rigid_rows, six_by_six

Real = NDArray[np.float64]


def coordinate_basis(structure: Structure) -> Real:
    """Displacement of all nodes over independent coordinates, ``x = T q``, shape (6 H, n); node 0 is clamped.

    Nodes are reached from the base: over a rigid link a node follows, over a joint it adds the joint's elastic
    directions, over a beam it adds six coordinates. Where a loop of constraints closes, T is narrowed to the null space
    of what is left. ``T^T K T`` is positive definite where the saddle system is invertible.
    """
    n_nodes = len(structure.positions)
    motion: dict[int, list[tuple[slice, Real]]] = {0: []}
    width = 0
    while len(motion) < n_nodes:
        node, terms, added = _next_node(structure, motion, width)
        motion[node] = terms
        width += added
    basis = np.zeros((6 * n_nodes, width))
    for node, terms in motion.items():
        for columns, block in terms:
            basis[6 * node : 6 * node + 6, columns] += block
    left = rigid_rows(structure) @ basis
    if np.abs(left).max(initial=0.0) > 1e-9:
        basis = basis @ null_space(left, rcond=1e-10)
    return basis


_Motion = dict[int, list[tuple[slice, Real]]]


def _next_node(structure: Structure, motion: _Motion, width: int) -> tuple[int, list[tuple[slice, Real]], int]:
    """A node that follows from one already reached: rigid links first, then joints, then beams."""
    for u, v in structure.rigid:
        for known, new in ((u, v), (v, u)):
            if known in motion and new not in motion:
                shift = rigid_motion(structure.positions[new] - structure.positions[known])
                return new, [(columns, shift @ block) for columns, block in motion[known]], 0
    for spring in structure.couplings:
        first, second = spring.nodes
        for known, new in ((first, second), (second, first)):
            if known in motion and new not in motion and np.isinf(spring.stiffness).any():
                elastic = _elastic_directions(spring, structure.positions[new])
                shift = rigid_motion(structure.positions[new] - structure.positions[known])
                carried = [(columns, shift @ block) for columns, block in motion[known]]
                return new, [*carried, (slice(width, width + elastic.shape[1]), elastic)], elastic.shape[1]
    free = next(node for node in range(len(structure.positions)) if node not in motion)
    return free, [(slice(width, width + 6), np.eye(6))], 6


def _elastic_directions(spring: Spring, position: Real) -> Real:
    """Motion of a node at ``position`` over the joint's elastic directions, shape (6, n_elastic)."""
    directions = six_by_six(spring.axes)[:, np.isfinite(spring.stiffness)]
    return np.asarray(rigid_motion(position - spring.place) @ directions)
