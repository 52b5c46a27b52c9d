"""Compiled loops over spectral lines and narrow bands: whitening and likelihood."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled


@compiled
def whiten_in_place(matrix: Complex) -> float:
    """Overwrite a Hermitian V (n, n) by the lower triangular W with ``W^H W = V^-1``; return ln det V.

    W is the inverse of V's Cholesky factor. The result is infinite if V is not positive definite.
    """
    log_determinant = _cholesky_in_place(matrix)
    if np.isfinite(log_determinant):
        _invert_in_place(matrix)
    return log_determinant


@compiled
def _cholesky_in_place(matrix: Complex) -> float:
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
    """Overwrite the lower triangle by its inverse, and the upper one by zeros."""
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


@compiled("(complex128[:,:,::1],)")
def whiten_lines(covariance: Complex) -> float:
    """Overwrite each V (n_lines, n, n) by its whitening W; return the sum of ln det V, as `whiten_in_place` does."""
    total = 0.0
    for k in range(len(covariance)):
        total += whiten_in_place(covariance[k])
    return total


@compiled("(complex128[:,:,::1], complex128[:,::1], float64[::1])")
def whitened_squares(white: Complex, lines: Complex, squares: Real) -> float:
    """Write ``|W_k r_k|^2`` of residual lines r (n_lines, n) into ``squares`` (n_lines,); return their sum.

    ``white`` (n_lines, n, n) is the lower triangular whitening W of each line.
    """
    total = 0.0
    for k in range(len(white)):
        square = 0.0
        for i in range(white.shape[1]):
            value = white[k, i, 0] * lines[k, 0]
            for j in range(1, i + 1):
                value += white[k, i, j] * lines[k, j]
            square += value.real**2 + value.imag**2
        squares[k] = square
        total += square
    return total


@compiled("(complex128[:,:,::1], complex128[:,:,::1], float64[:,:,:,::1])")
def whitened_columns(white: Complex, lines: Complex, out: Real) -> None:
    """Write real and imaginary parts of ``W_k A_k`` into ``out`` (2, n_lines, n, n_columns).

    A (n_lines, n, n_columns) are the columns of each line, W (n_lines, n, n) its lower triangular whitening.
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


@compiled(
    "(int64[::1], complex128[:,::1], float64[::1], complex128[:,:,::1], complex128[:,:,::1], complex128[:,:,:,::1])"
)
def average_bands(
    edges: NDArray[np.int64], residual: Complex, weights: Real, through: Complex, sample: Complex, unit_noise: Complex
) -> None:
    """Write the weighted mean of ``r r^H``, and that of ``g_q g_q^H`` for each force q, over each band.

    ``edges`` holds the index of the first line of each band, and the number of lines. ``residual`` is r, (n_lines, n),
    and ``weights`` (n_lines,) are 1 or less. ``through`` (n_lines, n, n_excitations) has the columns g_q. ``sample``
    (n_bands, n, n) and ``unit_noise`` (n_bands, n_excitations, n, n) receive the means.
    """
    n, m = through.shape[1], through.shape[2]
    sample[:] = 0.0
    unit_noise[:] = 0.0
    for b in range(len(edges) - 1):
        share = 1.0 / (edges[b + 1] - edges[b])
        for k in range(edges[b], edges[b + 1]):
            for i in range(n):
                for j in range(n):
                    sample[b, i, j] += share * weights[k] * residual[k, i] * residual[k, j].conjugate()
                    for q in range(m):
                        unit_noise[b, q, i, j] += share * through[k, i, q] * through[k, j, q].conjugate()


@compiled("(float64[:,::1], complex128[:,:,::1], float64[::1], complex128[:,:,::1])")
def line_covariances(own: Real, through: Complex, forces: Real, out: Complex) -> None:
    """Write the covariance ``diag(own) + G diag(forces) G^H`` of every line into ``out`` (n_lines, n, n).

    ``own`` (n_lines, n) and ``forces`` (n_excitations,), N^2, are the noise variances of responses and forces,
    ``through`` (n_lines, n, n_excitations) is the matrix G from forces to responses.
    """
    n, m = through.shape[1], through.shape[2]
    for k in range(len(own)):
        trace = 0.0
        for i in range(n):
            for j in range(i + 1):
                value = 0.0 + 0.0j
                for q in range(m):
                    value += forces[q] * through[k, i, q] * through[k, j, q].conjugate()
                out[k, i, j] = value
                out[k, j, i] = value.conjugate()
            trace += out[k, i, i].real
        for i in range(n):
            # a small multiple of the trace keeps the matrix positive definite if the responses have hardly any noise
            out[k, i, i] += own[k, i] + 1e-12 * trace


@compiled(
    "(Tuple((float64[::1],complex128[:,:,::1],complex128[:,:,:,::1],float64[:,::1])), float64[:,::1], "
    "float64[::1], Tuple((float64[:,::1],float64[::1])), "
    "Tuple((float64[:,:,::1],float64[:,:,::1],float64[:,::1])))",
)
def noise_likelihood(
    bands: tuple[Real, Complex, Complex, Real],
    own: Real,
    forces: Real,
    slopes: tuple[Real, Real],
    curvature: tuple[Real, Real, Real],
) -> float:
    """Return ``sum_b n_b (ln det V_b + tr V_b^-1 S_b)`` with ``V = diag(own + known) + sum_q forces_q T_q``.

    Parameters
    ----------
    bands
        Number of lines n_b (n_bands,), covariance S of the residual (n_bands, n, n), covariance T of the responses to
        unit noise of each force (n_bands, n_excitations, n, n), and known variance (n_bands, n).
    own : (n_bands, n)
        Noise variance of each response.
    forces : (n_excitations,), N^2
        Noise variance of each force.
    slopes
        Receives the derivatives by ln own (n_bands, n) and by ln forces (n_excitations,).
    curvature
        Receives the second derivatives: by ln own twice (n_bands, n, n), by ln own and ln forces
        (n_bands, n, n_excitations), and by ln forces twice (n_excitations, n_excitations).
    """
    counts, sample, unit_noise, known = bands
    by_own, by_force = slopes
    n = own.shape[1]
    cost = 0.0
    by_force[:] = 0.0
    curvature[2][:] = 0.0
    v = np.empty((n, n), dtype=np.complex128)
    inverse = np.empty((n, n), dtype=np.complex128)
    for b in range(len(counts)):
        _covariance(unit_noise[b], own[b] + known[b], forces, v)
        log_determinant = whiten_in_place(v)
        if not np.isfinite(log_determinant):
            return np.inf
        _product_of_inverse(v, inverse)
        misfit = _slope(inverse, sample[b], v)
        cost += counts[b] * (log_determinant + misfit)
        for i in range(n):
            by_own[b, i] = counts[b] * v[i, i].real * own[b, i]
        for q in range(len(forces)):
            by_force[q] += counts[b] * forces[q] * _trace_of_product(v, unit_noise[b, q])
        # v is V^-1 - V^-1 S V^-1 by now
        mixed = inverse - 2.0 * v
        _curvature(
            counts[b],
            (inverse, mixed),
            unit_noise[b],
            own[b],
            forces,
            (curvature[0][b], curvature[1][b], curvature[2]),
        )
        for i in range(n):
            curvature[0][b, i, i] += by_own[b, i]
    for q in range(len(forces)):
        curvature[2][q, q] += by_force[q]
    return cost


@compiled
def _curvature(
    count: float,
    matrices: tuple[Complex, Complex],
    unit_noise: Complex,
    own: Real,
    forces: Real,
    out: tuple[Real, Real, Real],
) -> None:
    """Write one band's curvature from V^-1 and ``2 V^-1 S V^-1 - V^-1``; that of forces with forces is added."""
    inverse, mixed = matrices
    by_own, by_both, by_force = out
    n, m = len(own), len(forces)
    inverse_noise, mixed_noise = np.empty((m, n, n), dtype=np.complex128), np.empty((m, n, n), dtype=np.complex128)
    for q in range(m):
        _product(inverse, unit_noise[q], inverse_noise[q])
        _product(mixed, unit_noise[q], mixed_noise[q])
    for i in range(n):
        for j in range(n):
            by_own[i, j] = count * own[i] * own[j] * (inverse[i, j] * mixed[j, i]).real
        for q in range(m):
            value = 0.0
            for k in range(n):
                value += (inverse_noise[q, i, k] * mixed[k, i]).real
            by_both[i, q] = count * own[i] * forces[q] * value
    for q in range(m):
        for p in range(m):
            by_force[q, p] += count * forces[q] * forces[p] * _trace_of_product(mixed_noise[q], inverse_noise[p])


@compiled("(complex128[:,::1], complex128[:,::1], complex128[:,::1])")
def _product(a: Complex, b: Complex, out: Complex) -> None:
    for i in range(len(a)):
        for j in range(len(a)):
            value = 0.0 + 0.0j
            for k in range(len(a)):
                value += a[i, k] * b[k, j]
            out[i, j] = value


@compiled("(complex128[:,:,::1], float64[::1], float64[::1], complex128[:,::1])")
def _covariance(unit_noise: Complex, own: Real, forces: Real, out: Complex) -> None:
    """Write ``diag(own) + sum_q forces_q T_q``, positive definite as in `line_covariances`."""
    out[:] = 0.0
    for q in range(len(forces)):
        out += forces[q] * unit_noise[q]
    ridge = 1e-12 * np.trace(out).real
    for i in range(len(out)):
        out[i, i] += own[i] + ridge


@compiled("(complex128[:,::1], complex128[:,::1], complex128[:,::1])")
def _slope(inverse: Complex, sample: Complex, out: Complex) -> float:
    """Write ``V^-1 - V^-1 S V^-1``; return ``tr V^-1 S``."""
    n = len(inverse)
    trace = 0.0
    for i in range(n):
        for j in range(n):
            out[i, j] = inverse[i, j]
        for k in range(n):
            value = 0.0 + 0.0j
            for j in range(n):
                value += inverse[i, j] * sample[j, k]
            if i == k:
                trace += value.real
            for j in range(n):
                out[i, j] -= value * inverse[k, j]
    return trace


@compiled
def _trace_of_product(a: Complex, b: Complex) -> float:
    total = 0.0
    for i in range(len(a)):
        for j in range(len(a)):
            total += (a[i, j] * b[j, i]).real
    return total


@compiled
def _product_of_inverse(white: Complex, inverse: Complex) -> None:
    """Write ``V^-1 = W^H W``."""
    n = len(white)
    for i in range(n):
        for j in range(n):
            value = 0.0 + 0.0j
            for k in range(max(i, j), n):
                value += white[k, i].conjugate() * white[k, j]
            inverse[i, j] = value
