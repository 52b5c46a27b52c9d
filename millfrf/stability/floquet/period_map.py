"""Map of the motion from one period of a collocated cut to the next; compiled."""

from typing import Any, NamedTuple

import numpy as np

from millfrf.core import Index, Real
from millfrf.core.compilation import compiled, inner_loop, product_loop

from .piece_response import PieceMatrices, solve


class CutPeriod(NamedTuple):
    """Matrices of one period at one speed and depth, from which the motions in the next follow.

    Motions are those of the tool that change the chip. The force at the nodes is that of the channels (motions and,
    with process damping, their velocities) less that of the motions when earlier passes left the surface.
    """

    matrices: PieceMatrices
    forcing: Real  # (forces, channels, n_nodes), N/m and N s/m
    first: Index  # (n_nodes + 1,): first block of each node
    source: Index  # (n_blocks,): piece whose motion a block takes, plus n_pieces in the period before
    blocks: Real  # (n_blocks, forces, motions count): force per motion at the nodes of the source
    # without blocks, (0, ...), the delayed force is that of the motion at the same node one period earlier

    @property
    def size(self) -> int:
        """Return the length of a vector of state and motions at all nodes."""
        return int(2 * self.matrices.gaps.shape[1] + self.blocks.shape[2] * len(self.matrices.shapes))


def period_example() -> tuple[Any, ...]:
    three, numbers, pivots = np.zeros((1, 1, 1)), np.zeros(2, dtype=np.int64), np.zeros((2, 1), dtype=np.int64)
    matrices = PieceMatrices(three, three, numbers, three, pivots, np.zeros((2, 1), dtype=complex))
    return CutPeriod(matrices, three, numbers, numbers, np.zeros((0, 1, 1))), np.zeros(3)


@product_loop
def _row_product(matrices: Real, number: int, row: int, values: Real, start: int) -> float:
    """Return the product of a row of a matrix and the values from ``start`` on."""
    total = 0.0
    for j in range(matrices.shape[2]):
        total += matrices[number, row, j] * values[start + j]
    return total


@inner_loop
def _same_nodes(forcing: Real, piece: int, count: int, before: Real, start: int, values: Real, size: int) -> None:
    """Write the force, with its sign turned, of the motions from ``start`` on at the nodes themselves."""
    motions = (len(before) - size) // forcing.shape[2]
    for a in range(len(forcing)):
        for i in range(count):
            total = 0.0
            for b in range(motions):
                total -= forcing[a, b, piece * count + i] * before[start + b * count + i]
            values[size + a * count + i] = total


@inner_loop
def _add_earlier(
    cut: tuple[Real, Index, Index, Real], piece: int, pieces: int, before: Real, now: Real, size: int, driven: Real
) -> None:
    """Write the force of earlier motions at the nodes of a piece, with its sign turned, after the state."""
    forcing, first, source, blocks = cut
    count, motions = forcing.shape[2] // pieces, blocks.shape[2]
    if not len(blocks):
        _same_nodes(forcing, piece, count, before, size + piece * motions, driven, size)
        return
    for j in range(size, len(driven)):
        driven[j] = 0.0
    for i in range(count):
        for block in range(first[piece * count + i], first[piece * count + i + 1]):
            late = source[block] >= pieces
            start = size + (source[block] - (pieces if late else 0)) * motions
            motion = before if late else now
            for a in range(len(forcing)):
                driven[size + a * count + i] -= _row_product(blocks, block, a, motion, start)


@inner_loop
def _product(columns: Real, shape: int, factors: Real, result: Real) -> None:
    """Write the product of a matrix, by columns, and a vector; two columns at a time."""
    many = len(factors)
    for i in range(len(result)):
        result[i] = factors[0] * columns[shape, 0, i]
    for j in range(1, many - 1, 2):
        first, second = factors[j], factors[j + 1]
        for i in range(len(result)):
            result[i] += first * columns[shape, j, i] + second * columns[shape, j + 1, i]
    if many % 2 == 0:
        for i in range(len(result)):
            result[i] += factors[many - 1] * columns[shape, many - 1, i]


@inner_loop
def _pass_piece(
    piece: int,
    matrices: PieceMatrices,
    cut: tuple[Real, Index, Index, Real],
    before: Real,
    now: Real,
    memory: tuple[Real, Real, Real],
) -> None:
    """Write the motions in a piece to ``now``.

    The first array of ``memory`` has the state at the beginning, and receives the force at the nodes after it; the last
    receives the state at the end.
    """
    driven, channels, state = memory
    inputs, states, shapes, factors, pivots, gaps = matrices
    forcing, blocks = cut[0], cut[3]
    size, pieces, n_forces = 2 * gaps.shape[1], len(shapes), len(forcing)
    motions, count = blocks.shape[2], forcing.shape[2] // pieces
    _add_earlier(cut, piece, pieces, before, now, size, driven)
    _product(inputs, shapes[piece], driven, channels)
    solve(factors, pivots, piece, channels)
    for i in range(motions):
        now[size + piece * motions + i] = channels[i]
    for a in range(n_forces):
        for c in range(forcing.shape[1]):
            for i in range(count):
                driven[size + a * count + i] += forcing[a, c, piece * count + i] * channels[c * count + i]
    for r in range(size):
        state[r] = _row_product(states, shapes[piece], r, driven, 0)


@compiled(example=period_example)
def next_period(cut: CutPeriod, vector: Real) -> tuple[Real, Real]:
    """Return state and motions (state, then nodes) after one period, and the force (n_nodes, forces) at the nodes.

    ``vector`` holds the structure's state at the beginning, and the motions at the nodes of the period before.
    """
    # taken from their tuples once: to take them in a loop counts a reference, which takes longer than the arithmetic
    matrices, forcing, first, source, blocks = cut
    rest, gaps = (forcing, first, source, blocks), matrices.gaps
    pieces, modes = len(matrices.shapes), gaps.shape[1]
    result, force = np.empty_like(vector), np.empty((forcing.shape[2], len(forcing)))
    driven, state = np.empty(matrices.inputs.shape[1]), vector[: 2 * modes].copy()
    memory, count = (driven, np.empty(matrices.inputs.shape[2]), state), forcing.shape[2] // pieces
    for k in range(pieces + 1):
        for r in range(modes):
            moved = complex(state[r], state[modes + r]) * gaps[k, r]
            state[r], state[modes + r] = moved.real, moved.imag
        if k < pieces:
            driven[: 2 * modes] = state
            _pass_piece(k, matrices, rest, vector, result, memory)
            for a in range(len(forcing)):
                force[k * count : (k + 1) * count, a] = driven[2 * modes + a * count : 2 * modes + (a + 1) * count]
    result[: 2 * modes] = state
    return result, force
