"""All roots (theta, depth) of the characteristic function, by winding numbers on cells; compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from cutting.compiled import compiled

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]


@compiled
def value(coefficients: Real, radius: float, theta: float, depth: float) -> tuple[complex, complex, complex]:
    """F and its derivatives by theta and by depth.

    Parameters
    ----------
    coefficients : (n + 1, n_powers)
        As in :class:`Characteristic`, of one speed.
    radius, depth
        m.
    theta
        rad.
    """
    degree = coefficients.shape[0] - 1
    powers = coefficients.shape[1]
    multiplier = complex(math.cos(theta), math.sin(theta))
    factor = 1.0 - multiplier.conjugate()
    b = depth / radius * factor
    total, by_theta, by_b = 0j, 0j, 0j
    turned = 1.0 + 0j
    for _ in range(degree // 2):
        turned *= multiplier
    for k in range(degree + 1):
        series, slope = complex(coefficients[k, powers - 1]), 0j
        for j in range(powers - 2, -1, -1):
            slope = slope * b + series
            series = series * b + coefficients[k, j]
        total += turned * series
        by_theta += 1j * (degree / 2 - k) * turned * series
        by_b += turned * slope
        turned *= multiplier.conjugate()
    by_theta += by_b * depth / radius * 1j * multiplier.conjugate()
    return total, by_theta, by_b * factor / radius


@compiled
def quick_value(coefficients: Real, needed: Index, radius: float, theta: float, depth: float) -> complex:
    """F alone, with only the powers that matter at this depth.

    Parameters
    ----------
    coefficients, radius, theta, depth
        As for :func:`value`.
    needed : (16,)
        Powers that matter in each sixteenth of the radius.
    """
    degree = coefficients.shape[0] - 1
    multiplier = complex(math.cos(theta), math.sin(theta))
    b = depth / radius * (1.0 - multiplier.conjugate())
    powers = needed[min(15, int(16 * abs(b)))]
    # real recurrence for a polynomial with real coefficients at a complex point (Knuth, TAOCP 2, section 4.6.4)
    twice, square = 2.0 * b.real, b.real * b.real + b.imag * b.imag
    turned = 1.0 + 0j
    for _ in range(degree // 2):
        turned *= multiplier
    total = 0j
    for k in range(degree + 1):
        one, two = coefficients[k, powers - 1], 0.0
        for j in range(powers - 2, 0, -1):
            one, two = coefficients[k, j] + twice * one + two, -square * one
        if powers > 1:
            total += turned * (b * one + (coefficients[k, 0] + two))
        else:
            total += turned * one
        turned *= multiplier.conjugate()
    return total


@compiled
def newton(
    coefficients: Real, radius: float, theta: float, depth: float, reach_theta: float, reach_depth: float
) -> tuple[bool, float, float, float]:
    """Refine a root; give it up where it leaves the reach of its first guess.

    Returns
    -------
    converged
    theta, depth
    growth
        Sign of d|mu|/da: positive where the multiplier leaves the circle with growing depth.
    """
    first_theta, first_depth = theta, depth
    for _ in range(30):
        total, by_theta, by_depth = value(coefficients, radius, theta, depth)
        determinant = by_theta.real * by_depth.imag - by_theta.imag * by_depth.real
        if determinant == 0.0:
            return False, theta, depth, 0.0
        step_theta = (total.real * by_depth.imag - total.imag * by_depth.real) / determinant
        step_depth = (by_theta.real * total.imag - by_theta.imag * total.real) / determinant
        theta -= step_theta
        depth -= step_depth
        if abs(theta - first_theta) > reach_theta or abs(depth - first_depth) > reach_depth:
            return False, theta, depth, 0.0
        if abs(step_theta) < 1e-12 and abs(step_depth) < 1e-11 * radius:
            # F is analytic in log mu = rho + i theta: d rho / da = Im(F_a / F_theta)
            return True, theta, depth, (by_depth / by_theta).imag
    return False, theta, depth, 0.0


@compiled
def turn(one: complex, other: complex) -> float:
    """Angle from one complex number to another, -pi ... pi."""
    ratio = other * one.conjugate()
    return math.atan2(ratio.imag, ratio.real)


@compiled
def period_doublings(
    coefficients: Real, needed: Index, radius: float, max_depth: float, count: int, found: Real, filled: int
) -> int:
    """Write roots at theta = pi, where F is real, into rows (theta, depth, growth) of ``found``."""
    step = max_depth / count
    before = quick_value(coefficients, needed, radius, math.pi, 0.0).real
    for k in range(1, count + 1):
        here = quick_value(coefficients, needed, radius, math.pi, k * step).real
        if before * here < 0.0 and filled < found.shape[0]:
            low, high, low_value, high_value = (k - 1) * step, k * step, before, here
            for _ in range(60):
                middle = low - low_value * (high - low) / (high_value - low_value)
                middle_value = value(coefficients, radius, math.pi, middle)[0].real
                if middle_value * high_value < 0.0:
                    low, low_value = high, high_value
                else:
                    low_value *= 0.5
                high, high_value = middle, middle_value
                if abs(high - low) < 1e-13 * radius or middle_value == 0.0:
                    break
            _, by_theta, by_depth = value(coefficients, radius, math.pi, high)
            found[filled, 0], found[filled, 1] = math.pi, high
            found[filled, 2] = (by_depth / by_theta).imag
            filled += 1
        before = here
    return filled


@compiled
def _put(
    stack: Real,
    corners: Complex,
    at: int,
    low: float,
    high: float,
    bottom: float,
    top: float,
    level: float,
    f00: complex,
    f10: complex,
    f11: complex,
    f01: complex,
) -> None:
    """Lay a cell and F at its corners, anticlockwise, on the stack."""
    stack[at, 0], stack[at, 1], stack[at, 2], stack[at, 3], stack[at, 4] = low, high, bottom, top, level
    corners[at, 0], corners[at, 1], corners[at, 2], corners[at, 3] = f00, f10, f11, f01


@compiled
def roots(
    coefficients: Real, needed: Index, radius: float, max_depth: float, angles: Real, rows: int, found: Real
) -> int:
    """Write all roots below ``max_depth`` into rows (theta, depth, growth) of ``found``; return how many.

    On each cell the turns of F along the four edges are added: a sum of one whole turn is one root inside. Cells with
    edges that turn by more than 1.2 rad are split into four until they are clear.

    Parameters
    ----------
    coefficients, needed, radius
        Of one speed.
    angles : (n_angles,), rad
        First edges of cells in theta, increasing, the last pi.
    rows
        First number of cells in depth.
    found : (most, 3)
        Receives the roots.
    """
    count = len(angles)
    filled = period_doublings(coefficients, needed, radius, max_depth, 8 * rows, found, 0)
    stack = np.empty((4096, 5))
    corners = np.empty((4096, 4), dtype=np.complex128)
    left = np.empty(rows + 1, dtype=np.complex128)
    right = np.empty(rows + 1, dtype=np.complex128)
    for j in range(rows + 1):
        left[j] = quick_value(coefficients, needed, radius, angles[0], max_depth * (j / rows) ** 1.5)
    for i in range(count - 1):
        low, high = angles[i], angles[i + 1]
        if i == count - 2:  # period doublings shall lie inside cells, not on their edges
            high += 0.37 * (high - low)
        for j in range(rows + 1):
            right[j] = quick_value(coefficients, needed, radius, high, max_depth * (j / rows) ** 1.5)
        for j in range(rows):
            bottom, top = max_depth * (j / rows) ** 1.5, max_depth * ((j + 1) / rows) ** 1.5
            _put(stack, corners, 0, low, high, bottom, top, 0.0, left[j], right[j], right[j + 1], left[j + 1])
            filled = _search(coefficients, needed, radius, stack, corners, found, filled)
        left, right = right, left
    return filled


@compiled
def _search(
    coefficients: Real, needed: Index, radius: float, stack: Real, corners: Complex, found: Real, filled: int
) -> int:
    """Work off a stack of cells that holds one to begin with."""
    depth_of_stack = 1
    while depth_of_stack:
        depth_of_stack -= 1
        at = depth_of_stack
        low, high, bottom, top, level = stack[at, 0], stack[at, 1], stack[at, 2], stack[at, 3], stack[at, 4]
        f00, f10, f11, f01 = corners[at, 0], corners[at, 1], corners[at, 2], corners[at, 3]
        one, two, three, four = turn(f00, f10), turn(f10, f11), turn(f11, f01), turn(f01, f00)
        largest = max(max(abs(one), abs(two)), max(abs(three), abs(four)))
        if largest < 1.2:
            continue
        winding = round((one + two + three + four) / (2 * math.pi))
        middle, height = (low + high) / 2, (bottom + top) / 2
        if level >= 2 and abs(winding) == 1:
            good, theta, depth, growth = newton(
                coefficients, radius, middle, height, 0.6 * (high - low), 0.6 * (top - bottom)
            )
            if good:
                filled = _keep(found, filled, theta, depth, growth, radius)
                continue
        if level >= 12 or (winding == 0 and level >= 6) or depth_of_stack + 4 > len(stack):
            continue
        centre = quick_value(coefficients, needed, radius, middle, height)
        south, north = (
            quick_value(coefficients, needed, radius, middle, bottom),
            quick_value(coefficients, needed, radius, middle, top),
        )
        west, east = (
            quick_value(coefficients, needed, radius, low, height),
            quick_value(coefficients, needed, radius, high, height),
        )
        deeper = level + 1.0
        _put(stack, corners, at, low, middle, bottom, height, deeper, f00, south, centre, west)
        _put(stack, corners, at + 1, middle, high, bottom, height, deeper, south, f10, east, centre)
        _put(stack, corners, at + 2, middle, high, height, top, deeper, centre, east, f11, north)
        _put(stack, corners, at + 3, low, middle, height, top, deeper, west, centre, north, f01)
        depth_of_stack += 4
    return filled


@compiled
def _keep(found: Real, filled: int, theta: float, depth: float, growth: float, radius: float) -> int:
    """Add a root unless it is at pi (found apart), beyond, or already there."""
    if theta > math.pi - 1e-6 or theta <= 0.0 or depth <= 0.0 or depth > radius / 2 or filled >= found.shape[0]:
        return filled
    for k in range(filled):
        if abs(found[k, 0] - theta) < 1e-8 and abs(found[k, 1] - depth) < 1e-8 * radius:
            return filled
    found[filled, 0], found[filled, 1], found[filled, 2] = theta, depth, growth
    return filled + 1


@compiled
def all_roots(
    coefficients: Real, needed: Index, radius: float, max_depth: float, angles: Real, rows: int, found: Real
) -> Index:
    """Roots at every speed: :func:`roots` for each row of ``coefficients``, ``needed``, ``angles`` and ``found``."""
    counts = np.zeros(len(coefficients), dtype=np.int64)
    for k in range(len(coefficients)):
        counts[k] = roots(coefficients[k], needed[k], radius, max_depth, angles[k], rows, found[k])
    return counts
