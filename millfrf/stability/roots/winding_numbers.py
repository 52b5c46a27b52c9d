"""Roots of the characteristic function by winding numbers on cells; compiled."""

import math

import numpy as np

from millfrf.core import Complex, Index, Real
from millfrf.core.compilation import compiled

from .characteristic import newton, values, workspace

PERIOD_DOUBLINGS_AT_PI = 1e-6
"""Roots nearer to pi than this are at pi, rad."""


@compiled
def keep(found: Real, filled: int, theta: float, depth: float, growth: float) -> int:
    """Add a root (theta, depth, growth), mirrored into (0, pi], unless it is there; return how many there are."""
    if theta > math.pi:
        theta = 2 * math.pi - theta
    if theta > math.pi - PERIOD_DOUBLINGS_AT_PI:
        theta = math.pi
    if theta <= 0.0 or depth <= 0.0 or filled >= found.shape[0]:
        return filled
    for k in range(filled):
        if abs(found[k, 0] - theta) < 1e-8 and abs(found[k, 1] - depth) < 1e-8 * depth:
            return filled
    found[filled, 0], found[filled, 1], found[filled, 2] = theta, depth, growth
    return filled + 1


@compiled
def _at_pi(series: Real, needed: Index, radius: float, depth: float, cell: Real, work: Real, out: Complex) -> float:
    """The real F(pi, a) at one depth; ``cell`` is memory for two numbers."""
    theta, place = cell[:1], cell[1:]
    theta[0], place[0] = math.pi, depth
    values(series, needed, radius, theta, place, 1, work, out)
    return float(out[0].real)


@compiled
def _period_doubling(
    series: Real, needed: Index, radius: float, low: float, high: float, low_value: float, high_value: float
) -> tuple[float, float]:
    """Depth between two where the real F(pi, a) changes sign, by the Illinois rule and Newton's; sign of its growth."""
    cell, out, work = np.empty(2), np.empty(1, dtype=np.complex128), workspace(series.shape[2], 1)
    bottom, top = low, high
    for _ in range(60):
        depth = low - low_value * (high - low) / (high_value - low_value)
        here = _at_pi(series, needed, radius, depth, cell, work, out)
        if here * high_value < 0.0:
            low, low_value = high, high_value
        else:
            low_value *= 0.5
        high, high_value = depth, here
        if abs(high - low) < 1e-6 * depth or high_value == 0.0:
            break
    # where rounding keeps the steps from dying out, the last of them is still the better depth
    _, _, refined, growth = newton(series, radius, math.pi, high, top - bottom, top - bottom)
    return (refined if bottom <= refined <= top else high), growth


@compiled
def _dip(series: Real, needed: Index, radius: float, depths: Real, heights: Real) -> tuple[float, float]:
    """Depth between three, and F(pi, a) there, at which F dips lowest or has changed its sign: two close roots.

    The smallest |F| of the three is in the middle and all have one sign; parabolas close in on the minimum.
    """
    cell, out, work = np.empty(2), np.empty(1, dtype=np.complex128), workspace(series.shape[2], 1)
    a, b, c = depths[0], depths[1], depths[2]
    fa, fb, fc = heights[0], heights[1], heights[2]
    first = abs(fb)
    for trial in range(12):
        if trial == 4 and abs(fb) > 0.3 * first:
            break
        one, two = (b - a) * (fb - fc), (b - c) * (fb - fa)
        least = b - 0.5 * ((b - a) * one - (b - c) * two) / (one - two) if one != two else b
        if not a < least < c or abs(least - b) < 1e-3 * (c - a):
            least = b + 0.3 * (c - b) if c - b > b - a else b - 0.3 * (b - a)
        here = _at_pi(series, needed, radius, least, cell, work, out)
        if here * fb <= 0.0:
            return least, here
        if abs(here) < abs(fb):
            if least > b:
                a, fa, b, fb = b, fb, least, here
            else:
                c, fc, b, fb = b, fb, least, here
        elif least > b:
            c, fc = least, here
        else:
            a, fa = least, here
    return b, fb


@compiled
def period_doublings(
    series: Real, needed: Index, radius: float, depths: Real, heights: Real, found: Real, filled: int
) -> int:
    """Write the period doublings between depths at which F(pi, a) is known, pairs of close ones included."""
    for k in range(1, len(depths)):
        if heights[k - 1] * heights[k] < 0.0:
            filled = _between(
                series, needed, radius, depths[k - 1], depths[k], heights[k - 1], heights[k], found, filled
            )
        elif k + 1 < len(depths) and heights[k] * heights[k + 1] > 0.0:
            low = min(abs(heights[k - 1]), abs(heights[k + 1]))
            if abs(heights[k]) > low:
                continue
            least, here = _dip(series, needed, radius, depths[k - 1 : k + 2], heights[k - 1 : k + 2])
            if here * heights[k] < 0.0:
                filled = _between(series, needed, radius, depths[k - 1], least, heights[k - 1], here, found, filled)
                filled = _between(series, needed, radius, least, depths[k + 1], here, heights[k + 1], found, filled)
    return filled


@compiled
def _between(
    series: Real,
    needed: Index,
    radius: float,
    low: float,
    high: float,
    one: float,
    two: float,
    found: Real,
    filled: int,
) -> int:
    """Add the period doubling between two depths."""
    depth, growth = _period_doubling(series, needed, radius, low, high, one, two)
    return keep(found, filled, math.pi, depth, growth)


DEEPEST = 14
"""A cell is halved both ways so often at most."""


@compiled
def turn(one: complex, other: complex) -> float:
    """Angle from one complex number to another, -pi ... pi."""
    ratio = other * one.conjugate()
    return math.atan2(ratio.imag, ratio.real)


@compiled
def clear(one: complex, other: complex) -> bool:
    """Whether one complex number is turned by less than 1.2 rad from another."""
    ratio = other * one.conjugate()
    return abs(ratio.imag) < 2.572 * ratio.real


@compiled
def put(
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


@compiled(
    "(float64[:,:,:,::1], int64[::1], float64, float64[:,::1], complex128[:,::1], float64[:,::1], "
    "float64[:,::1], int64)",
)
def search(
    series: Real,
    needed: Index,
    radius: float,
    stack: Real,
    corners: Complex,
    work: Real,
    found: Real,
    filled: int,
) -> tuple[int, float]:
    """Work off a stack of cells that holds one to begin with.

    Returns
    -------
    filled
        How many roots there are now.
    resolved
        Depth below which nothing was left unresolved, m; infinite where that is so everywhere.
    """
    theta, depth, out = np.empty(5), np.empty(5), np.empty(5, dtype=np.complex128)
    depth_of_stack, resolved = 1, np.inf
    while depth_of_stack:
        depth_of_stack -= 1
        at = depth_of_stack
        low, high, bottom, top, level = stack[at, 0], stack[at, 1], stack[at, 2], stack[at, 3], stack[at, 4]
        f00, f10, f11, f01 = corners[at, 0], corners[at, 1], corners[at, 2], corners[at, 3]
        if clear(f00, f10) and clear(f10, f11) and clear(f11, f01) and clear(f01, f00):
            continue
        winding = round((turn(f00, f10) + turn(f10, f11) + turn(f11, f01) + turn(f01, f00)) / (2 * math.pi))
        middle, height = (low + high) / 2, (bottom + top) / 2
        if level >= DEEPEST or (level >= 2 and abs(winding) == 1) or (level >= 5 and winding == 0):
            # a cell without a root of its own looks for the root beside it that turns F along its edges
            reach = 0.6 if abs(winding) == 1 else 2.0
            good, root_theta, root_depth, growth = newton(
                series, radius, middle, height, reach * (high - low), reach * (top - bottom)
            )
            if good:
                filled = keep(found, filled, root_theta, root_depth, growth)
                own = low <= root_theta <= high and bottom <= root_depth <= top
                if abs(winding) == 1 or level >= DEEPEST or (winding == 0 and not own):
                    continue
        if level >= DEEPEST or depth_of_stack + 4 > len(stack):
            resolved = min(resolved, bottom)
            continue
        theta[0], theta[1], theta[2], theta[3], theta[4] = middle, middle, middle, low, high
        depth[0], depth[1], depth[2], depth[3], depth[4] = height, bottom, top, height, height
        values(series, needed, radius, theta, depth, 5, work, out)
        centre, south, north, west, east = out[0], out[1], out[2], out[3], out[4]
        deeper = level + 1.0
        put(stack, corners, at, low, middle, bottom, height, deeper, f00, south, centre, west)
        put(stack, corners, at + 1, middle, high, bottom, height, deeper, south, f10, east, centre)
        put(stack, corners, at + 2, middle, high, height, top, deeper, centre, east, f11, north)
        put(stack, corners, at + 3, low, middle, height, top, deeper, west, centre, north, f01)
        depth_of_stack += 4
    return filled, resolved


WINDING_NUMBERS_AT_PI = 4
"""Steps in a row of cells at which the real F(pi, a) is looked at."""


@compiled(
    "(float64[:,:,:,::1], int64[::1], float64, float64[::1], float64[::1], bool, float64[:,::1])",
)
def roots(
    series: Real,
    needed: Index,
    radius: float,
    edges: Real,
    angles: Real,
    lowest: bool,
    found: Real,
) -> tuple[int, float]:
    """Write roots between the first and the last edge into rows (theta, depth, growth) of ``found``.

    On each cell the turns of F along the four edges are added: a sum of one whole turn is one root inside. Cells with
    edges that turn by more than 1.2 rad are split into four until they are clear. At pi, where F is real, its changes
    of sign are period doublings, and so are its roots in cells there: two close ones do not change the sign.

    Parameters
    ----------
    series, needed, radius
        Power series of the transition at one speed, as for :func:`values`.
    edges : (n_rows + 1,), m
        Depths that bound the rows of cells, increasing.
    angles : (n_angles,), rad
        Edges of cells in theta, increasing, the last pi.
    lowest
        Stop above the row of cells with the lowest root.
    found : (most, 3)
        Receives the roots.

    Returns
    -------
    filled
        How many there are; -1 where F is lost in rounding.
    resolved
        Depth below which no cell was left unresolved, m; infinite where all were resolved.
    """
    count = len(angles)
    # the row's own depths, and one beyond, so that a dip about its end is seen
    lanes = count + WINDING_NUMBERS_AT_PI + 1
    filled, resolved = 0, np.inf
    stack, corners = np.empty((256, 5)), np.empty((256, 4), dtype=np.complex128)
    work = workspace(series.shape[2], lanes)
    small = workspace(series.shape[2], 5)
    theta, depth = np.full(lanes, math.pi), np.full(lanes, edges[0])
    below, above = np.empty(lanes, dtype=np.complex128), np.empty(lanes, dtype=np.complex128)
    heights, depths = np.empty(WINDING_NUMBERS_AT_PI + 2), np.empty(WINDING_NUMBERS_AT_PI + 2)
    theta[:count] = angles
    # period doublings shall lie inside cells, not on their edges
    theta[count - 1] += 0.37 * (theta[count - 1] - theta[count - 2])
    values(series, needed, radius, theta, depth, lanes, work, below)
    depths[0], heights[0] = edges[0], below[count].real
    for j in range(len(edges) - 1):
        bottom, top = edges[j], edges[j + 1]
        depth[:count] = top
        for k in range(WINDING_NUMBERS_AT_PI + 1):
            depth[count + k] = min(bottom + (top - bottom) * (k + 1) / WINDING_NUMBERS_AT_PI, radius / 2)
            depths[k + 1] = depth[count + k]
        values(series, needed, radius, theta, depth, lanes, work, above)
        if (above == 0).any():
            return -1, resolved
        heights[1:] = above[count:].real
        filled = period_doublings(series, needed, radius, depths, heights, found, filled)
        depths[0], heights[0] = top, heights[WINDING_NUMBERS_AT_PI]
        for i in range(count - 1):
            f00, f10, f11, f01 = below[i], below[i + 1], above[i + 1], above[i]
            if clear(f00, f10) and clear(f10, f11) and clear(f11, f01) and clear(f01, f00):
                continue
            put(stack, corners, 0, theta[i], theta[i + 1], bottom, top, 0.0, f00, f10, f11, f01)
            filled, here = search(series, needed, radius, stack, corners, small, found, filled)
            resolved = min(resolved, here)
        if lowest and filled and found[:filled, 1].min() <= top:
            break
        below, above = above, below
    return filled, resolved


@compiled(
    "(float64[:,:,:,:,::1], int64[:,::1], float64, float64[::1], float64[:,::1], bool, float64[:,:,::1], float64[::1])",
)
def all_roots(
    series: Real,
    needed: Index,
    radius: float,
    edges: Real,
    angles: Real,
    lowest: bool,
    found: Real,
    resolved: Real,
) -> Index:
    """Roots at every speed: (theta, depth, growth), lowest first.

    Parameters
    ----------
    series, needed, angles
        One row a speed, otherwise as for :func:`roots`.
    radius, edges
        As for :func:`roots`.
    found : (n_speeds, most, 3)
        Receives the roots; all of them, or the lowest alone.
    resolved : (n_speeds,), m
        Receives the depths below which no cell was left unresolved.

    Returns
    -------
    (n_speeds,)
        How many; -1 where the characteristic function is lost in rounding.
    """
    counts = np.zeros(len(series), dtype=np.int64)
    for s in range(len(series)):
        first = np.empty((found.shape[1], 3))
        count, resolved[s] = roots(series[s], needed[s], radius, edges, angles[s], lowest, first)
        if count < 0:
            counts[s] = -1
            continue
        order = np.argsort(first[:count, 1])
        if lowest:
            order = order[:1]
        for row, k in enumerate(order):
            found[s, row] = first[k]
        counts[s] = len(order)
    return counts


@compiled(
    "(float64[:,:,:,:,::1], float64, int64[::1], float64[::1], float64[::1], float64[::1], float64[::1])",
)
def refined(finer: Real, radius: float, speed: Index, theta: Real, depth: Real, growth: Real, error: Real) -> None:
    """Move roots to where they lie on series with more nodes; what that changes is the error.

    Parameters
    ----------
    finer : (n_speeds, n_windows, n_powers, n, n)
        Power series with more nodes, as in ``TransitionSeries``.
    radius : m
        Largest ``|b|`` that the series are made for.
    speed, theta, depth, growth : (n_roots,)
        Index of the speed, argument of the multiplier (rad), depth (m) and growth of each root; the last three are
        overwritten.
    error : (n_roots,), m
        Receives the error; the depth itself where the root is lost.
    """
    for k in range(len(speed)):
        good, moved, final, there = newton(finer[speed[k]], radius, theta[k], depth[k], 0.1, 0.1 * depth[k])
        error[k] = depth[k]
        if good:
            error[k] = abs(final - depth[k]) + 1e-9 * final
            theta[k], depth[k], growth[k] = moved, final, there
