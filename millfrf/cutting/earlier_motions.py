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
    """Blocks of the force per earlier motion; those of a node follow each other."""

    first: Index  # (n_nodes + 1,): first block of each node
    source: Index  # (capacity,): piece whose motion a block takes, plus the number of pieces in the period before
    blocks: Real  # (capacity, 3, count, 3), N/m


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
        _clear(earlier.blocks, last)
        last += 1
    half = (pieces.ends[piece] - pieces.begins[piece]) / 2
    at = min(max((angle - pieces.begins[piece]) / half - 1.0, -1.0), 1.0)
    _interpolate(at, pieces, matrix, earlier.blocks, block)
    return last


@inner_loop
def _clear(blocks: Real, block: int) -> None:
    for a in range(blocks.shape[1]):
        for c in range(blocks.shape[2]):
            for b in range(blocks.shape[3]):
                blocks[block, a, c, b] = 0.0


@inner_loop
def _interpolate(at: float, pieces: PieceNodes, matrix: Real, blocks: Real, block: int) -> None:
    """Add a matrix times the Lagrange polynomials of a piece's nodes at a point in -1 ... 1 to a block."""
    count, total = len(pieces.nodes), 0.0
    for c in range(count):
        gap = at - pieces.nodes[c]
        if abs(gap) < 1e-13:
            for a in range(3):
                for b in range(3):
                    blocks[block, a, c, b] += matrix[a, b]
            return
        total += pieces.weights[c] / gap
    for c in range(count):
        share = pieces.weights[c] / (at - pieces.nodes[c]) / total
        for a in range(3):
            for b in range(3):
                blocks[block, a, c, b] += share * matrix[a, b]
