"""Products and solutions of small matrices, line by line. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

Complex = NDArray[np.complex128]


def line_products(one: Complex, other: Complex) -> Complex:
    """``A_k B_k`` of every line: one BLAS call a line would cost more than the product.

    Parameters
    ----------
    one : (n_lines, n, m)
        Matrix A of each line, in any unit.
    other : (n_lines, m) or (n_lines, m, n_columns)
        Vectors or matrices B.

    Examples
    --------
    >>> line_products(np.full((1, 2, 2), 1 + 0j), np.array([[1, 2j]])).tolist()
    [[(1+2j), (1+2j)]]
    """
    columns = np.ascontiguousarray(other, dtype=complex).reshape(*other.shape[:2], -1)
    out = np.empty((*one.shape[:2], columns.shape[2]), dtype=complex)
    _multiply(np.ascontiguousarray(one, dtype=complex), columns, out)
    return out.reshape(*one.shape[:2], *other.shape[2:])


def closed_loop(receptance: Complex, feedback: Complex) -> Complex:
    """``(I + H K)^-1 H`` of every line, with H (n_lines, n, m) and K (n_lines, m, n); further columns of H go along.

    Raises
    ------
    numpy.linalg.LinAlgError
        ``I + H K`` is singular at a line.
    """
    loop = line_products(receptance[:, :, : feedback.shape[1]], feedback)
    diagonal = np.arange(loop.shape[1])
    loop[:, diagonal, diagonal] += 1
    result = np.array(receptance, dtype=complex, order="C")
    if not _solve(loop, result):
        raise np.linalg.LinAlgError("the feedback around the structure is singular at a line")
    return result


@compiled
def _multiply(one: Complex, other: Complex, out: Complex) -> None:
    """Write the products."""
    for k in range(len(one)):
        for i in range(one.shape[1]):
            for c in range(other.shape[2]):
                value = one[k, i, 0] * other[k, 0, c]
                for j in range(1, one.shape[2]):
                    value += one[k, i, j] * other[k, j, c]
                out[k, i, c] = value


@compiled
def _solve(matrix: Complex, right: Complex) -> bool:
    """Overwrite ``right`` by ``A^-1 B`` (Gauss, with the largest pivot of each column); False where A is singular."""
    n = matrix.shape[1]
    for k in range(len(matrix)):
        a, b = matrix[k], right[k]
        for j in range(n):
            if not _bring_up(a, b, j):
                return False
            inverse = 1.0 / a[j, j]
            for i in range(j + 1, n):
                factor = a[i, j] * inverse
                for c in range(j + 1, n):
                    a[i, c] -= factor * a[j, c]
                for c in range(b.shape[1]):
                    b[i, c] -= factor * b[j, c]
        _substitute_back(a, b)
    return True


@compiled
def _bring_up(matrix: Complex, right: Complex, column: int) -> bool:
    """Exchange rows so that the largest entry of a column below the diagonal is the pivot; False if it is zero."""
    chosen = column
    for i in range(column + 1, len(matrix)):
        if abs(matrix[i, column]) > abs(matrix[chosen, column]):
            chosen = i
    if chosen != column:
        for c in range(len(matrix)):
            matrix[column, c], matrix[chosen, c] = matrix[chosen, c], matrix[column, c]
        for c in range(right.shape[1]):
            right[column, c], right[chosen, c] = right[chosen, c], right[column, c]
    pivot: bool = abs(matrix[column, column]) != 0.0
    return pivot


@compiled
def _substitute_back(upper: Complex, right: Complex) -> None:
    """Overwrite ``right`` by ``U^-1 B``."""
    n = len(upper)
    for i in range(n - 1, -1, -1):
        inverse = 1.0 / upper[i, i]
        for c in range(right.shape[1]):
            value = right[i, c]
            for j in range(i + 1, n):
                value -= upper[i, j] * right[j, c]
            right[i, c] = value * inverse
