"""Loops over lines with small matrices: whitening. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

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
    """Write the Cholesky factor over the lower triangle; return ln of the determinant, or infinity."""
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
    """Overwrite a lower triangle by its inverse, and what is above it by zeros."""
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
    """Whiten every V (n_lines, n, n) in place; return the sum of ln det V, infinity where one has none."""
    total = 0.0
    for k in range(len(covariance)):
        total += whiten_in_place(covariance[k])
    return total


@compiled
def size_of_white(white: Complex, lines: Complex, sizes: Real) -> float:
    """Write ``|W_k r_k|^2`` of each line into sizes (n_lines,), for W (n_lines, n, n) lower triangular; return the sum.

    Parameters
    ----------
    white : (n_lines, n, n)
        Whitening W_k of each line, lower triangular.
    lines : (n_lines, n)
        Residual r_k of each line.
    sizes : (n_lines,)
        Receives the squares.
    """
    total = 0.0
    for k in range(len(white)):
        own = 0.0
        for i in range(white.shape[1]):
            value = white[k, i, 0] * lines[k, 0]
            for j in range(1, i + 1):
                value += white[k, i, j] * lines[k, j]
            own += value.real**2 + value.imag**2
        sizes[k] = own
        total += own
    return total


@compiled
def whitened_columns(white: Complex, lines: Complex, out: Real) -> None:
    """Write ``W_k A_k`` of each line as real rows: real parts above imaginary ones.

    Parameters
    ----------
    white : (n_lines, n, n)
        Whitening W_k of each line, lower triangular.
    lines : (n_lines, n, n_columns)
        Columns A_k of each line that are whitened.
    out : (2, n_lines, n, n_columns)
        Receives the real parts, then the imaginary parts.
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
