"""Loops over narrow bands of lines with one covariance of noise each: likelihood, slopes, curvature. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

from .line_loops import whiten_in_place

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@compiled
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


@compiled
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


@compiled
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


@compiled
def _product(one: Complex, other: Complex, out: Complex) -> None:
    """Write ``A B``."""
    for i in range(len(one)):
        for j in range(len(one)):
            value = 0.0 + 0.0j
            for k in range(len(one)):
                value += one[i, k] * other[k, j]
            out[i, j] = value


@compiled
def _covariance(through: Complex, own: Real, pushed: Real, out: Complex) -> None:
    """Write ``diag(own) + sum_q pushed_q T_q``, and a trace of itself that keeps it positive definite."""
    out[:] = 0.0
    for q in range(len(pushed)):
        out += pushed[q] * through[q]
    ridge = 1e-12 * np.trace(out).real
    for i in range(len(out)):
        out[i, i] += own[i] + ridge


@compiled
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
