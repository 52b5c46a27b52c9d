"""Loops over lines with one small covariance matrix each: whitening, likelihood of noise. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting.compiled import compiled

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@compiled
def whiten_in_place(matrix: Complex) -> float:
    """Overwrite a Hermitian V (n, n) by the lower triangular W with ``W^H W = V^-1``; return ln det V, or infinity.

    W is the inverse of V's Cholesky factor; infinity says that V is not positive definite.
    """
    n = len(matrix)
    log_determinant = 0.0
    for j in range(n):
        pivot = matrix[j, j].real
        for k in range(j):
            pivot -= matrix[j, k].real ** 2 + matrix[j, k].imag ** 2
        if not (0.0 < pivot < np.inf):
            return np.inf
        log_determinant += np.log(pivot)
        root = np.sqrt(pivot)
        matrix[j, j] = root
        for i in range(j + 1, n):
            value = matrix[i, j]
            for k in range(j):
                value -= matrix[i, k] * matrix[j, k].conjugate()
            matrix[i, j] = value / root
    for j in range(n):
        matrix[j, j] = 1.0 / matrix[j, j].real
        for i in range(j):
            matrix[i, j] = 0.0
    for i in range(1, n):
        for j in range(i):
            value = matrix[i, j] * matrix[j, j].real
            for k in range(j + 1, i):
                value += matrix[i, k] * matrix[k, j]
            matrix[i, j] = -value * matrix[i, i].real
    return log_determinant


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
def noise_likelihood(
    counts: Real, sample: Complex, through: Complex, own: Real, pushed: Real, by_own: Real, by_force: Real
) -> float:
    """``sum_b n_b (ln det V_b + tr V_b^-1 S_b)``, ``V = diag(own) + sum_q pushed_q T_q``, and its slopes.

    Parameters
    ----------
    counts : (n_bands,)
    sample : (n_bands, n, n)
        Covariance of the residual in each band.
    through : (n_bands, n_excitations, n, n)
        What unit noise of each force leaves in the responses.
    own : (n_bands, n)
    pushed : (n_excitations,)
    by_own : (n_bands, n)
        Receives the slope by ln own.
    by_force : (n_excitations,)
        Receives the slope by ln pushed.
    """
    n, m = own.shape[1], len(pushed)
    cost = 0.0
    by_force[:] = 0.0
    v = np.empty((n, n), dtype=np.complex128)
    inverse = np.empty((n, n), dtype=np.complex128)
    weighed = np.empty((n, n), dtype=np.complex128)
    for b in range(len(counts)):
        trace = 0.0
        for i in range(n):
            for j in range(n):
                v[i, j] = 0.0
                for q in range(m):
                    v[i, j] += pushed[q] * through[b, q, i, j]
            trace += v[i, i].real
        for i in range(n):
            v[i, i] += own[b, i] + 1e-12 * trace
        log_determinant = whiten_in_place(v)
        if not np.isfinite(log_determinant):
            return np.inf
        _product_of_inverse(v, inverse)
        misfit = 0.0
        for i in range(n):
            for j in range(n):
                weighed[i, j] = 0.0
                for k in range(n):
                    weighed[i, j] += inverse[i, k] * sample[b, k, j]
            misfit += weighed[i, i].real
        cost += counts[b] * (log_determinant + misfit)
        # slope = V^-1 - V^-1 S V^-1; v serves again
        for i in range(n):
            for j in range(n):
                v[i, j] = inverse[i, j]
                for k in range(n):
                    v[i, j] -= weighed[i, k] * inverse[k, j]
        for i in range(n):
            by_own[b, i] = counts[b] * v[i, i].real * own[b, i]
        for q in range(m):
            total = 0.0
            for i in range(n):
                for j in range(n):
                    total += (v[i, j] * through[b, q, j, i]).real
            by_force[q] += counts[b] * total * pushed[q]
    return cost


@compiled
def _product_of_inverse(white: Complex, inverse: Complex) -> None:
    """``V^-1 = W^H W``."""
    n = len(white)
    for i in range(n):
        for j in range(n):
            value = 0.0 + 0.0j
            for k in range(max(i, j), n):
                value += white[k, i].conjugate() * white[k, j]
            inverse[i, j] = value


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
