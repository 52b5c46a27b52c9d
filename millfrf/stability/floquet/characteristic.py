"""The characteristic function of a milling process and its derivatives, from series of its transition; compiled."""

import math

import numpy as np

from millfrf.core import Complex, Index, Real
from millfrf.core.compilation import compiled

NOISE = 1e-13  # a determinant below this share of its terms is lost in rounding


@compiled
def workspace(size: int, lanes: int) -> Real:
    """Allocate the memory that :func:`values` needs for up to ``lanes`` points."""
    return np.empty((6 + 6 * size * size, lanes))


@compiled(
    "(float64[:,:,:,::1], int64[::1], float64, float64[::1], float64[::1], int64, float64[:,::1], complex128[::1])",
)
def values(
    series: Real, needed: Index, radius: float, theta: Real, depth: Real, count: int, work: Real, out: Complex
) -> None:
    """Compute ``F = det[mu - M(b)] mu^(-n/2)`` at ``count`` points with ``mu = exp(i theta)``, ``b = a (1 - 1 / mu)``.

    The powers are evaluated at all points together, by the real recurrence for a polynomial with real coefficients at a
    complex point (Knuth, The Art of Computer Programming 2, section 4.6.4).

    Parameters
    ----------
    theta, depth : (count or more,)
        Arguments of the multiplier (rad) and axial depths (m) at the points.
    out : (count or more,)
        Receives F, or zero where F is lost in rounding, which happens where M grows by about seven orders of magnitude.
    """
    windows, size = series.shape[0], series.shape[2]
    entries = size * size
    real, imaginary, twice, square = work[0], work[1], work[2], work[3]
    upper, lower = work[4], work[5]
    farthest = 0.0
    for p in range(count):
        share = depth[p] / radius
        real[p], imaginary[p] = share * (1.0 - math.cos(theta[p])), share * math.sin(theta[p])
        twice[p], square[p] = 2.0 * real[p], -(real[p] * real[p] + imaginary[p] * imaginary[p])
        farthest = max(farthest, -square[p])
    powers = min(needed[min(15, int(16 * math.sqrt(farthest)))], series.shape[1])
    total, window, product = 6, 6 + 2 * entries, 6 + 4 * entries
    for w in range(windows):
        at = total if w == 0 else window
        for e in range(entries):
            i, j = e // size, e % size
            top = series[w, powers - 1, i, j] if powers > 1 else 0.0
            for p in range(count):
                upper[p], lower[p] = top, 0.0
            for k in range(powers - 2, 0, -1):
                coefficient = series[w, k, i, j]
                for p in range(count):
                    last = upper[p]
                    upper[p] = coefficient + twice[p] * last + lower[p]
                    lower[p] = square[p] * last
            coefficient = series[w, 0, i, j]
            to_real, to_imaginary = work[at + e], work[at + entries + e]
            for p in range(count):
                to_real[p] = real[p] * upper[p] + lower[p] + coefficient
                to_imaginary[p] = imaginary[p] * upper[p]
        if w > 0:
            _times(work, window, total, product, size, count)
            total, product = product, total
    for p in range(count):
        out[p] = _determinant(work, total, size, p, complex(math.cos(theta[p]), math.sin(theta[p])))


@compiled
def _times(work: Real, left: int, right: int, product: int, size: int, count: int) -> None:
    """Multiply two matrices at every point; the real parts of all entries are stored before the imaginary parts."""
    entries = size * size
    for i in range(size):
        for j in range(size):
            to_real, to_imaginary = work[product + i * size + j], work[product + entries + i * size + j]
            for p in range(count):
                to_real[p], to_imaginary[p] = 0.0, 0.0
            for k in range(size):
                a, b = work[left + i * size + k], work[left + entries + i * size + k]
                c, d = work[right + k * size + j], work[right + entries + k * size + j]
                for p in range(count):
                    to_real[p] += a[p] * c[p] - b[p] * d[p]
                    to_imaginary[p] += a[p] * d[p] + b[p] * c[p]


@compiled
def _determinant(work: Real, start: int, size: int, point: int, multiplier: complex) -> complex:
    """Compute ``det[mu - M] mu^(-n/2)`` with the matrix M stored for one point; zero if it is lost in rounding."""
    entries = size * size
    if size == 2:
        a = multiplier - complex(work[start, point], work[start + 4, point])
        d = multiplier - complex(work[start + 3, point], work[start + 7, point])
        b = complex(work[start + 1, point], work[start + 5, point])
        c = complex(work[start + 2, point], work[start + 6, point])
        diagonal, cross = a * d, b * c
        if abs(diagonal - cross) < NOISE * (abs(diagonal) + abs(cross)):
            return 0j
        return (diagonal - cross) * multiplier.conjugate()
    matrix = np.empty((size, size), dtype=np.complex128)
    largest = 0.0
    for i in range(size):
        for j in range(size):
            e = start + i * size + j
            matrix[i, j] = -complex(work[e, point], work[e + entries, point])
            largest = max(largest, abs(matrix[i, j]))
        matrix[i, i] += multiplier
    total = eliminate(matrix, np.empty((size, 0), dtype=np.complex128))
    smallest = abs(matrix[0, 0])
    for k in range(1, size):
        smallest = min(smallest, abs(matrix[k, k]))
    if smallest < NOISE * largest:
        return 0j
    for _ in range(size // 2):
        total *= multiplier.conjugate()
    return total


@compiled(
    "(complex128[:,::1], complex128[:,::1])",
)
def eliminate(matrix: Complex, right: Complex) -> complex:
    """Solve ``matrix x = right`` in place by elimination with row exchanges; return the determinant.

    A pivot of zero is replaced by a tiny number.
    """
    size, columns = matrix.shape[0], right.shape[1]
    total = 1.0 + 0j
    for k in range(size):
        if _exchange(matrix, right, k):
            total = -total
        total *= matrix[k, k]
        if matrix[k, k] == 0.0:
            matrix[k, k] = 1e-30
        inverse = 1.0 / matrix[k, k]
        for i in range(k + 1, size):
            factor = matrix[i, k] * inverse
            for j in range(k + 1, size):
                matrix[i, j] -= factor * matrix[k, j]
            for j in range(columns):
                right[i, j] -= factor * right[k, j]
    for i in range(size - 1, -1, -1):
        for j in range(columns):
            for k in range(i + 1, size):
                right[i, j] -= matrix[i, k] * right[k, j]
            right[i, j] /= matrix[i, i]
    return total


@compiled
def _exchange(matrix: Complex, right: Complex, k: int) -> bool:
    """Move the largest entry of column k at or below the diagonal onto the diagonal; return whether rows changed."""
    chosen, largest = k, -1.0
    for i in range(k, len(matrix)):
        reach = abs(matrix[i, k].real) + abs(matrix[i, k].imag)
        if reach > largest:
            chosen, largest = i, reach
    if chosen == k:
        return False
    for j in range(k, len(matrix)):
        matrix[k, j], matrix[chosen, j] = matrix[chosen, j], matrix[k, j]
    for j in range(right.shape[1]):
        right[k, j], right[chosen, j] = right[chosen, j], right[k, j]
    return True


@compiled(
    "(float64[:,:,:,::1], float64, complex128)",
)
def transition(series: Real, radius: float, b: complex) -> tuple[Complex, Complex]:
    """Compute M(b) and its derivative by ``b / radius`` at one b (m), with all powers of the series."""
    windows, powers, size = series.shape[0], series.shape[1], series.shape[2]
    share = b / radius
    matrix, slope = np.zeros((size, size), dtype=np.complex128), np.zeros((size, size), dtype=np.complex128)
    for i in range(size):
        matrix[i, i] = 1.0
    window, steep = np.empty((size, size), dtype=np.complex128), np.empty((size, size), dtype=np.complex128)
    matrix_next, slope_next = np.empty_like(matrix), np.empty_like(matrix)
    for w in range(windows):
        for i in range(size):
            for j in range(size):
                value, derivative = complex(series[w, powers - 1, i, j]), 0j
                for k in range(powers - 2, -1, -1):
                    derivative = derivative * share + value
                    value = value * share + series[w, k, i, j]
                window[i, j], steep[i, j] = value, derivative
        for i in range(size):
            for j in range(size):
                value, derivative = 0j, 0j
                for k in range(size):
                    value += window[i, k] * matrix[k, j]
                    derivative += window[i, k] * slope[k, j] + steep[i, k] * matrix[k, j]
                matrix_next[i, j], slope_next[i, j] = value, derivative
        matrix, matrix_next = matrix_next, matrix
        slope, slope_next = slope_next, slope
    return matrix, slope


@compiled(
    "(float64[:,:,:,::1], float64, float64, float64)",
)
def slopes(series: Real, radius: float, theta: float, depth: float) -> tuple[complex, complex]:
    """Compute the logarithmic derivatives of F by theta (1/rad) and by depth (1/m)."""
    size = series.shape[2]
    multiplier = complex(math.cos(theta), math.sin(theta))
    factor = 1.0 - multiplier.conjugate()
    matrix, slope = transition(series, radius, depth * factor)
    right = np.zeros((size, 2 * size), dtype=np.complex128)
    for i in range(size):
        for j in range(size):
            matrix[i, j] = -matrix[i, j]
            right[i, j] = slope[i, j] / radius
        matrix[i, i] += multiplier
        right[i, size + i] = 1.0
    eliminate(matrix, right)
    by_b, by_multiplier = 0j, 0j
    for i in range(size):
        by_b -= right[i, i]
        by_multiplier += right[i, size + i]
    by_theta = 1j * (multiplier * by_multiplier + by_b * depth * multiplier.conjugate()) - 0.5j * size
    return by_theta, by_b * factor


@compiled
def newton(
    series: Real, radius: float, theta: float, depth: float, reach_theta: float, reach_depth: float
) -> tuple[bool, float, float, float]:
    """Refine a root by Newton's method; return whether it converged near its first guess, theta, depth and growth.

    The growth has the sign of d|mu|/da: it is positive if the multiplier leaves the circle as the depth increases. At
    theta = pi only the depth changes.
    """
    first_theta, first_depth = theta, depth
    by_theta, by_depth = 1.0 + 0j, 0j
    step_theta, step_depth = 1.0, 1.0
    for _ in range(30):
        by_theta, by_depth = slopes(series, radius, theta, depth)
        if theta == math.pi:
            step_theta, step_depth = 0.0, (1.0 / by_depth).real
        else:
            determinant = by_theta.real * by_depth.imag - by_theta.imag * by_depth.real
            if determinant == 0.0:
                return False, theta, depth, 0.0
            step_theta, step_depth = by_depth.imag / determinant, -by_theta.imag / determinant
        theta -= step_theta
        depth -= step_depth
        if not (abs(theta - first_theta) <= reach_theta and abs(depth - first_depth) <= reach_depth):
            return False, theta, depth, 0.0
        if abs(step_theta) < 1e-10 and abs(step_depth) < 1e-10 * depth:
            # F is analytic in log mu = rho + i theta: d rho / da = Im(F_a / F_theta)
            return True, theta, depth, (by_depth / by_theta).imag
    # rounding can keep the steps from vanishing
    converged = abs(step_theta) < 1e-7 and abs(step_depth) < 1e-7 * depth
    return converged, theta, depth, (by_depth / by_theta).imag
