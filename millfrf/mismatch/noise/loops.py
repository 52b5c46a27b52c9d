"""Loops over spectral lines and narrow bands: whitening and likelihood; compiled."""

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real
from millfrf.core.compilation import compiled


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


@compiled(
    "(complex128[:,:,::1],)",
)
def whiten_lines(covariance: Complex) -> float:
    """Whiten every V (n_lines, n, n) in place; return the sum of ln det V, infinity where one has none."""
    total = 0.0
    for k in range(len(covariance)):
        total += whiten_in_place(covariance[k])
    return total


@compiled(
    "(complex128[:,:,::1], complex128[:,::1], float64[::1])",
)
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


@compiled(
    "(complex128[:,:,::1], complex128[:,:,::1], float64[:,:,:,::1])",
)
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


@compiled(
    "(int64[::1], complex128[:,::1], float64[::1], complex128[:,:,::1], complex128[:,:,::1], complex128[:,:,:,::1])",
)
def lump_lines(
    edges: NDArray[np.int64], residual: Complex, weights: Real, through: Complex, sample: Complex, passed: Complex
) -> None:
    """Write the mean weighed ``r r^H`` of each band, and the mean of what unit noise of each force leaves there.

    Parameters
    ----------
    edges : (n_bands + 1,)
        Index of the first line of each band, and the number of lines.
    residual : (n_lines, n)
        Residual lines of the responses.
    weights : (n_lines,)
        Weight of each line, 1 or less.
    through : (n_lines, n, n_excitations)
        Matrix G from forces to responses at each line.
    sample : (n_bands, n, n)
        Receives the mean of ``r r^H`` over each band.
    passed : (n_bands, n_excitations, n, n)
        Receives the covariance that unit noise of each force leaves in each band.
    """
    n, m = through.shape[1], through.shape[2]
    sample[:] = 0.0
    passed[:] = 0.0
    for b in range(len(edges) - 1):
        share = 1.0 / (edges[b + 1] - edges[b])
        for k in range(edges[b], edges[b + 1]):
            for i in range(n):
                for j in range(n):
                    sample[b, i, j] += share * weights[k] * residual[k, i] * residual[k, j].conjugate()
                    for q in range(m):
                        passed[b, q, i, j] += share * through[k, i, q] * through[k, j, q].conjugate()


@compiled(
    "(float64[:,::1], complex128[:,:,::1], float64[::1], complex128[:,:,::1])",
)
def line_covariances(own: Real, through: Complex, pushed: Real, out: Complex) -> None:
    """Write ``diag(own) + G diag(pushed) G^H`` of every line, with a trace of itself that keeps it positive definite.

    Parameters
    ----------
    own : (n_lines, n)
        Noise variance of each response at each line.
    through : (n_lines, n, n_excitations)
        Matrix G from forces to responses at each line.
    pushed : (n_excitations,), N^2
        Noise variance of each force at a line.
    out : (n_lines, n, n)
        Receives the covariance of each line.
    """
    n, m = through.shape[1], through.shape[2]
    for k in range(len(own)):
        trace = 0.0
        for i in range(n):
            for j in range(i + 1):
                value = 0.0 + 0.0j
                for q in range(m):
                    value += pushed[q] * through[k, i, q] * through[k, j, q].conjugate()
                out[k, i, j] = value
                out[k, j, i] = value.conjugate()
            trace += out[k, i, i].real
        for i in range(n):
            out[k, i, i] += own[k, i] + 1e-12 * trace


@compiled(
    "(Tuple((float64[::1],complex128[:,:,::1],complex128[:,:,:,::1],float64[:,::1])), float64[:,::1], "
    "float64[::1], Tuple((float64[:,::1],float64[::1])), "
    "Tuple((float64[:,:,::1],float64[:,:,::1],float64[:,::1])))",
)
def noise_likelihood(
    bands: tuple[Real, Complex, Complex, Real],
    own: Real,
    pushed: Real,
    slopes: tuple[Real, Real],
    curvature: tuple[Real, Real, Real],
) -> float:
    """Return ``sum_b n_b (ln det V_b + tr V_b^-1 S_b)``, and write its slopes and curvature.

    The covariance of a band is ``V = diag(own + known) + sum_q pushed_q T_q``.

    Parameters
    ----------
    bands
        Lines in each band (n_bands,), covariance of the residual (n_bands, n, n), what unit noise of each force leaves
        in the responses (n_bands, n_excitations, n, n), and variance that is known beforehand (n_bands, n).
    own : (n_bands, n)
        Noise variance of each response in each band.
    pushed : (n_excitations,), N^2
        Noise variance of each force at a line.
    slopes
        Receives the slopes by ln own (n_bands, n) and by ln pushed (n_excitations,).
    curvature
        Receives second derivatives: by ln own twice (n_bands, n, n), by ln own and ln pushed
        (n_bands, n, n_excitations), and by ln pushed twice (n_excitations, n_excitations).
    """
    counts, sample, through, known = bands
    by_own, by_force = slopes
    n = own.shape[1]
    cost = 0.0
    by_force[:] = 0.0
    curvature[2][:] = 0.0
    v = np.empty((n, n), dtype=np.complex128)
    inverse = np.empty((n, n), dtype=np.complex128)
    for b in range(len(counts)):
        _covariance(through[b], own[b] + known[b], pushed, v)
        log_determinant = whiten_in_place(v)
        if not np.isfinite(log_determinant):
            return np.inf
        _product_of_inverse(v, inverse)
        misfit = _slope(inverse, sample[b], v)
        cost += counts[b] * (log_determinant + misfit)
        for i in range(n):
            by_own[b, i] = counts[b] * v[i, i].real * own[b, i]
        for q in range(len(pushed)):
            by_force[q] += counts[b] * pushed[q] * _trace_of_product(v, through[b, q])
        # v is V^-1 - V^-1 S V^-1
        bent = inverse - 2.0 * v
        _curvature(
            counts[b],
            (inverse, bent),
            through[b],
            own[b],
            pushed,
            (curvature[0][b], curvature[1][b], curvature[2]),
        )
        for i in range(n):
            curvature[0][b, i, i] += by_own[b, i]
    for q in range(len(pushed)):
        curvature[2][q, q] += by_force[q]
    return cost


@compiled
def _curvature(
    count: float,
    between: tuple[Complex, Complex],
    through: Complex,
    own: Real,
    pushed: Real,
    out: tuple[Real, Real, Real],
) -> None:
    """Write one band's curvature from V^-1 and ``2 V^-1 S V^-1 - V^-1``; that of forces with forces is added up."""
    inverse, bent = between
    by_own, mixed, by_force = out
    n, m = len(own), len(pushed)
    passed, drawn = np.empty((m, n, n), dtype=np.complex128), np.empty((m, n, n), dtype=np.complex128)
    for q in range(m):
        _product(inverse, through[q], passed[q])
        _product(bent, through[q], drawn[q])
    for i in range(n):
        for j in range(n):
            by_own[i, j] = count * own[i] * own[j] * (inverse[i, j] * bent[j, i]).real
        for q in range(m):
            value = 0.0
            for k in range(n):
                value += (passed[q, i, k] * bent[k, i]).real
            mixed[i, q] = count * own[i] * pushed[q] * value
    for q in range(m):
        for p in range(m):
            by_force[q, p] += count * pushed[q] * pushed[p] * _trace_of_product(drawn[q], passed[p])


@compiled(
    "(complex128[:,::1], complex128[:,::1], complex128[:,::1])",
)
def _product(one: Complex, other: Complex, out: Complex) -> None:
    """Write ``A B``."""
    for i in range(len(one)):
        for j in range(len(one)):
            value = 0.0 + 0.0j
            for k in range(len(one)):
                value += one[i, k] * other[k, j]
            out[i, j] = value


@compiled(
    "(complex128[:,:,::1], float64[::1], float64[::1], complex128[:,::1])",
)
def _covariance(through: Complex, own: Real, pushed: Real, out: Complex) -> None:
    """Write ``diag(own) + sum_q pushed_q T_q``, and a trace of itself that keeps it positive definite."""
    out[:] = 0.0
    for q in range(len(pushed)):
        out += pushed[q] * through[q]
    ridge = 1e-12 * np.trace(out).real
    for i in range(len(out)):
        out[i, i] += own[i] + ridge


@compiled(
    "(complex128[:,::1], complex128[:,::1], complex128[:,::1])",
)
def _slope(inverse: Complex, sample: Complex, out: Complex) -> float:
    """Write ``V^-1 - V^-1 S V^-1``; return ``tr V^-1 S``."""
    n = len(inverse)
    trace = 0.0
    for i in range(n):
        for j in range(n):
            out[i, j] = inverse[i, j]
        for k in range(n):
            weighed = 0.0 + 0.0j
            for j in range(n):
                weighed += inverse[i, j] * sample[j, k]
            if i == k:
                trace += weighed.real
            for j in range(n):
                out[i, j] -= weighed * inverse[k, j]
    return trace


@compiled
def _trace_of_product(one: Complex, other: Complex) -> float:
    """Real part of ``tr A B``."""
    total = 0.0
    for i in range(len(one)):
        for j in range(len(one)):
            total += (one[i, j] * other[j, i]).real
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
