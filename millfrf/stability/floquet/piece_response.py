"""Response of the structure within the collocated pieces of a period, closed by the cutting force; compiled."""

from typing import NamedTuple

import numpy as np

from millfrf.core import Complex, Index, Real
from millfrf.core.compilation import compiled, inner_loop


class PieceMatrices(NamedTuple):
    """Matrices of the pieces of a period, by columns; nodes follow each other in a channel or force.

    With the structure's state z = (Re q, Im q) at the beginning of a piece, and the force B of earlier motions at its
    nodes, the channels there are ``W = (I - gain forcing)^-1 inputs (z, -B)`` with ``inputs = (ring, gain)``. From the
    force ``F = forcing W - B`` follows the state at the end, ``states (z, F)``.
    """

    inputs: Real  # (n_shapes, size + count forces, count channels)
    states: Real  # (n_shapes, size, size + count forces), by rows
    shapes: Index  # (n_pieces,): of each piece, as pieces of equal length respond alike
    factors: Real  # (n_pieces, count channels, count channels): of (I - gain forcing), for `solve`
    pivots: Index  # (n_pieces, count channels)
    gaps: Complex  # (n_pieces + 1, n_modes): by which q changes between two pieces


@compiled(
    "(complex128[::1], complex128[:,::1], complex128[:,::1], float64[:,::1], float64[::1], float64[::1], float64, "
    "float64[::1], float64[:,::1], float64[:,:,::1])"
)
def piece_matrices(
    poles: Complex,
    seen: Complex,
    left: Complex,
    direct: Real,
    begins: Real,
    ends: Real,
    duration: float,
    nodes: Real,
    integral: Real,
    forcing: Real,
) -> PieceMatrices:
    """Compute the matrices from the force per channel at the nodes (forces, channels, n_nodes)."""
    pieces, count, modes = len(begins), len(nodes), len(poles)
    channels, forces = direct.shape
    n, columns = count * channels, 2 * modes + count * forces
    inputs, states = np.zeros((pieces, columns, n)), np.zeros((pieces, 2 * modes, columns))
    shapes, pivots = np.empty(pieces, dtype=np.int64), np.empty((pieces, n), dtype=np.int64)
    factors, memory = np.empty((pieces, n, n)), np.empty(n)
    gaps = np.empty((pieces + 1, modes), dtype=np.complex128)
    end, last, shape = 0.0, -1.0, -1
    for k in range(pieces):
        half = (ends[k] - begins[k]) / 2
        for r in range(modes):
            gaps[k, r] = np.exp(poles[r] * (begins[k] - end))
        end = ends[k]
        if abs(half - last) > 1e-12 * half:
            shape, last = shape + 1, half
            _respond(poles, seen, left, direct, half, nodes, integral, inputs[shape], states[shape])
        shapes[k] = shape
        _close(inputs, shape, 2 * modes, forcing, k, factors)
        _factorise(factors, k, pivots, memory)
    for r in range(modes):
        gaps[pieces, r] = np.exp(poles[r] * (duration - end))
    return PieceMatrices(inputs, states, shapes, factors, pivots, gaps)


@inner_loop
def _close(inputs: Real, shape: int, size: int, forcing: Real, piece: int, factors: Real) -> None:
    """Write the columns of ``I - gain forcing``; the columns of the gain follow the first ``size``."""
    forces, channels, n = len(forcing), forcing.shape[1], factors.shape[2]
    count = n // channels
    for c in range(channels):
        for j in range(count):
            column = c * count + j
            for i in range(n):
                factors[piece, column, i] = 0.0
            for a in range(forces):
                share = forcing[a, c, piece * count + j]
                for i in range(n):
                    factors[piece, column, i] -= share * inputs[shape, size + a * count + j, i]
            factors[piece, column, column] += 1.0


@inner_loop
def _eliminate(factors: Real, piece: int, count: int, values: Real) -> None:
    """Subtract multiples of the first ``count`` columns of a lower triangular factor, two at a time."""
    n = len(values)
    for k in range(0, count - 1, 2):
        first = values[k]
        second = values[k + 1] - first * factors[piece, k, k + 1]
        values[k + 1] = second
        for i in range(k + 2, n):
            values[i] -= first * factors[piece, k, i] + second * factors[piece, k + 1, i]
    if count % 2:
        first = values[count - 1]
        for i in range(count, n):
            values[i] -= first * factors[piece, count - 1, i]


@inner_loop
def _factorise(factors: Real, piece: int, pivots: Index, memory: Real) -> None:
    """Replace the columns of a matrix by its triangular factors, with partial pivoting (Golub & Van Loan, 3.4)."""
    n = len(memory)
    for j in range(n):
        for i in range(n):
            memory[i] = factors[piece, j, i]
        for k in range(j):
            p = pivots[piece, k]
            memory[k], memory[p] = memory[p], memory[k]
        _eliminate(factors, piece, j, memory)
        largest = j
        for i in range(j + 1, n):
            if abs(memory[i]) > abs(memory[largest]):
                largest = i
        pivots[piece, j] = largest
        if largest != j:
            memory[j], memory[largest] = memory[largest], memory[j]
            for k in range(j):
                upper = factors[piece, k, j]
                factors[piece, k, j], factors[piece, k, largest] = factors[piece, k, largest], upper
        inverse = 1.0 / memory[j]
        for i in range(j + 1):
            factors[piece, j, i] = memory[i]
        for i in range(j + 1, n):
            factors[piece, j, i] = memory[i] * inverse


@inner_loop
def solve(factors: Real, pivots: Index, piece: int, values: Real) -> None:
    """Solve the equations of a piece; the right side in ``values`` becomes the solution."""
    n = len(values)
    for k in range(n):
        p = pivots[piece, k]
        values[k], values[p] = values[p], values[k]
    _eliminate(factors, piece, n, values)
    for k in range(n - 1, 0, -2):
        last = values[k] / factors[piece, k, k]
        other = (values[k - 1] - last * factors[piece, k, k - 1]) / factors[piece, k - 1, k - 1]
        values[k], values[k - 1] = last, other
        for i in range(k - 1):
            values[i] -= last * factors[piece, k, i] + other * factors[piece, k - 1, i]
    if n % 2:
        values[0] /= factors[piece, 0, 0]


@compiled
def _respond(
    poles: Complex,
    seen: Complex,
    left: Complex,
    direct: Real,
    half: float,
    nodes: Real,
    integral: Real,
    inputs: Real,
    states: Real,
) -> None:
    """Write the structure's response in a piece: to its state at the beginning, and to forces at the nodes."""
    count, modes = len(nodes), len(poles)
    channels, forces = direct.shape
    size, gain = 2 * modes, inputs[2 * modes :]
    for r in range(modes):
        over = np.exp(poles[r] * 2 * half)
        states[r, r], states[r, modes + r] = over.real, -over.imag
        states[modes + r, r], states[modes + r, modes + r] = over.imag, over.real
        waves = np.exp(poles[r] * half * (nodes + 1.0))
        backs = 2 * half / waves
        for a in range(channels):
            for i in range(count):
                moved = 2 * seen[r, a] * waves[i]
                inputs[r, a * count + i], inputs[modes + r, a * count + i] = moved.real, -moved.imag
        for b in range(forces):
            for i in range(count):
                pushed = left[r, b] * over * backs[i] * (0.5 * integral[count - 1, i])
                column = size + b * count + i
                states[r, column], states[modes + r, column] = pushed.real, pushed.imag
        _add_response(seen, left, r, waves, backs, integral, gain)
    for i in range(count):
        for a in range(channels):
            for b in range(forces):
                gain[b * count + i, a * count + i] += direct[a, b]


@inner_loop
def _add_response(
    seen: Complex, left: Complex, mode: int, waves: Complex, backs: Complex, integral: Real, gain: Real
) -> None:
    """Add the response of one mode at the nodes to forces at the nodes."""
    count, channels, forces = len(waves), seen.shape[1], left.shape[1]
    for b in range(forces):
        for j in range(count):
            pushed = backs[j] * left[mode, b]
            for a in range(channels):
                share = seen[mode, a] * pushed
                for i in range(count):
                    gain[b * count + j, a * count + i] += integral[i, j] * (
                        share.real * waves[i].real - share.imag * waves[i].imag
                    )
