"""Force of edges per motion of the tool in earlier passes, interpolated between the nodes of a period; compiled."""

from typing import NamedTuple

import numpy as np

from millfrf.core import Index, Real
from millfrf.core.compilation import inner_loop


class PieceNodes(NamedTuple):
    """Nodes in the pieces of a period, with what interpolation between them needs."""

    begins: Real  # (n_pieces,), rad
    ends: Real  # (n_pieces,), rad
    period: float  # rad
    nodes: Real  # (count,), in -1 ... 1
    weights: Real  # (count,): barycentric


class EarlierMotions(NamedTuple):
    """Blocks of the force per earlier motion in some of the directions X, Y, Z; those of a node follow each other."""

    first: Index  # (n_nodes + 1,): first block of each node
    source: Index  # (capacity,): piece whose motion a block takes, plus the number of pieces in the period before
    blocks: Real  # (capacity, n_forces, n_motions count), N/m
    forces: Index  # (n_forces,): their directions
    motions: Index  # (n_motions,)
    shares: Real  # (count,): working memory

    @classmethod
    def empty(cls, nodes: int, count: int, capacity: int, forces: Index, motions: Index) -> "EarlierMotions":
        """Return room for blocks of a number of nodes, ``count`` in a piece; without room they are left out."""
        return cls(
            np.zeros(nodes + 1, dtype=np.int64),
            np.zeros(capacity, dtype=np.int64),
            np.zeros((capacity, len(forces), len(motions) * count)),
            forces,
            motions,
            np.zeros(count),
        )


@inner_loop
def add_earlier(earlier: EarlierMotions, first: int, last: int, angle: float, pieces: PieceNodes, matrix: Real) -> int:
    """Add a matrix for the motion at an earlier angle (rad), which is interpolated between the nodes of its piece.

    Return the number of blocks in use; -1: there is no room for another.
    """
    before = 0
    while angle < -1e-12 * pieces.period:
        angle += pieces.period
        before = len(pieces.begins)
    piece = max(int(np.searchsorted(pieces.begins, angle + 1e-9)) - 1, 0)
    block = first
    while block < last and earlier.source[block] != piece + before:
        block += 1
    if block == last:
        if last == len(earlier.source):
            return -1
        earlier.source[last] = piece + before
        last += 1
    half = (pieces.ends[piece] - pieces.begins[piece]) / 2
    at = min(max((angle - pieces.begins[piece]) / half - 1.0, -1.0), 1.0)
    _interpolation(at, pieces, earlier.shares)
    count = len(pieces.nodes)
    for a in range(len(earlier.forces)):
        for b in range(len(earlier.motions)):
            value = matrix[earlier.forces[a], earlier.motions[b]]
            for c in range(count):
                earlier.blocks[block, a, b * count + c] += value * earlier.shares[c]
    return last


@inner_loop
def _interpolation(at: float, pieces: PieceNodes, shares: Real) -> None:
    """Write the Lagrange polynomials of a piece's nodes at a point in -1 ... 1."""
    count, total = len(pieces.nodes), 0.0
    for c in range(count):
        gap = at - pieces.nodes[c]
        if abs(gap) < 1e-13:
            for other in range(count):
                shares[other] = 0.0
            shares[c] = 1.0
            return
        shares[c] = pieces.weights[c] / gap
        total += shares[c]
    for c in range(count):
        shares[c] /= total
