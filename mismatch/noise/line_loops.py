"""Loops over lines with small matrices: whitening, and modal models with their derivatives. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting.compilation import compiled

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@compiled
def whiten_in_place(matrix: Complex) -> float:
    """Overwrite a Hermitian V (n, n) by the lower triangular W with ``W^H W = V^-1``; return ln det V, or infinity.

    W is the inverse of V's Cholesky factor; infinity says that V is not positive definite.
    """
    log_determinant = _cholesky_in_place(matrix)
    if np.isfinite(log_determinant):
        _invert_in_place(matrix)
    return log_determinant


@compiled
def _cholesky_in_place(matrix: Complex) -> float:
    """Lower Cholesky factor over the lower triangle; ln of the determinant, or infinity."""
    n = len(matrix)
    log_determinant = 0.0
    for j in range(n):
        pivot = matrix[j, j].real
        for k in range(j):
            pivot -= matrix[j, k].real ** 2 + matrix[j, k].imag ** 2
        if not (0.0 < pivot < np.inf):
            return np.inf
        log_determinant += np.log(pivot)
        matrix[j, j] = np.sqrt(pivot)
        for i in range(j + 1, n):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k].conjugate()
            matrix[i, j] = value / matrix[j, j].real
    return log_determinant


@compiled
def _invert_in_place(lower: Complex) -> None:
    """Inverse of a lower triangle, zeros above it."""
    n = len(lower)
    for j in range(n):
        lower[j, j] = 1.0 / lower[j, j].real
        lower[:j, j] = 0.0
    for i in range(1, n):
        for j in range(i):
            value = lower[i, j] * lower[j, j].real
            for k in range(j + 1, i):
                value += lower[i, k] * lower[k, j]
            lower[i, j] = -value * lower[i, i].real


@compiled
def whiten_lines(covariance: Complex) -> float:
    """Whitening of every V (n_lines, n, n), in place; return the sum of ln det V, infinity where one has none."""
    total = 0.0
    for k in range(len(covariance)):
        total += whiten_in_place(covariance[k])
    return total


@compiled
def whitened_columns(white: Complex, lines: Complex, out: Real) -> None:
    """Write ``W_k A_k`` of each line as real rows: real parts above imaginary ones.

    Parameters
    ----------
    white : (n_lines, n, n)
        Lower triangular.
    lines : (n_lines, n, n_columns)
    out : (2, n_lines, n, n_columns)
    """
    n = white.shape[1]
    for k in range(len(white)):
        for i in range(n):
            for c in range(lines.shape[2]):
                value = white[k, i, 0] * lines[k, 0, c]
                for j in range(1, i + 1):
                    value += white[k, i, j] * lines[k, j, c]
                out[0, k, i, c] = value.real
                out[1, k, i, c] = value.imag


@compiled
def modal_displacement(s: Complex, poles: Complex, right: Complex, left: Complex, force: Complex, out: Complex) -> None:
    """Write ``sum_r right_r (left_r . F) / (s - p_r)`` and its conjugate half.

    Parameters
    ----------
    s : (n,), 1/s
    poles : (n_modes,), 1/s
    right : (n_modes, n_responses)
    left : (n_modes, n_excitations)
    force : (n, n_excitations)
    out : (n, n_responses)
    """
    for k in range(len(s)):
        out[k] = 0.0
        for r in range(len(poles)):
            push, pull = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(left.shape[1]):
                push += left[r, q] * force[k, q]
                pull += left[r, q].conjugate() * force[k, q]
            push /= s[k] - poles[r]
            pull /= s[k] - poles[r].conjugate()
            for p in range(right.shape[1]):
                out[k, p] += right[r, p] * push + right[r, p].conjugate() * pull


@compiled
def modal_slopes(
    s: Complex,
    force: Complex,
    modes: tuple[Complex, Complex, Complex],
    units: tuple[Complex, Complex, Real, Real],
    factor: Complex,
    out: Complex,
) -> None:
    """Write the derivative of ``factor * (H F)`` by every number of every mode, as `ModelShape` orders them.

    Parameters
    ----------
    s : (n,), 1/s
    force : (n, n_excitations)
    modes
        Poles (n_modes,), right (n_modes, n_responses) and left vectors (n_modes, n_excitations).
    units
        Change of each pole by a unit of frequency and of damping, units of right and of left entries, each (n_modes,).
    factor : (n, n_responses)
    out : (n, n_responses, n_columns)
        Columns after the modes' are left alone.
    """
    poles, right, left = modes
    by_frequency, by_damping, right_unit, left_unit = units
    n, m = right.shape[1], left.shape[1]
    size = 2 + 2 * n + 2 * m
    for k in range(len(s)):
        for r in range(len(poles)):
            first = r * size
            up, down = 1.0 / (s[k] - poles[r]), 1.0 / (s[k] - poles[r].conjugate())
            push, pull = 0.0 + 0.0j, 0.0 + 0.0j
            for q in range(m):
                push += left[r, q] * force[k, q]
                pull += left[r, q].conjugate() * force[k, q]
            push *= up
            pull *= down
            for p in range(n):
                one, other = factor[k, p] * right[r, p], factor[k, p] * right[r, p].conjugate()
                row = out[k, p]
                row[first] = one * up * push * by_frequency[r] + other * down * pull * by_frequency[r].conjugate()
                row[first + 1] = one * up * push * by_damping[r] + other * down * pull * by_damping[r].conjugate()
                row[first + 2 : first + 2 + 2 * n] = 0.0
                row[first + 2 + p] = factor[k, p] * right_unit[r] * (push + pull)
                row[first + 2 + n + p] = 1j * factor[k, p] * right_unit[r] * (push - pull)
                for q in range(m):
                    a, b = one * up * force[k, q], other * down * force[k, q]
                    row[first + 2 + 2 * n + q] = left_unit[r] * (a + b)
                    row[first + 2 + 2 * n + m + q] = 1j * left_unit[r] * (a - b)
