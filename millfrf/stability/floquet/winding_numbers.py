"""Roots of the characteristic function by winding numbers on cells; compiled."""

import math

import numpy as np

from millfrf.core import Complex, Index, Real
from millfrf.core.compilation import compiled

from .characteristic import newton, values, workspace

AT_PI = 1e-6  # rad; roots nearer to pi are period doublings
DEEPEST = 14  # largest number of times that a cell is halved in both directions
STEPS_AT_PI = 4  # steps in a row of cells at which the real F(pi, a) is evaluated


@compiled
def keep(table: Real, filled: int, theta: float, depth: float, growth: float) -> int:
    """Add a root (theta, depth, growth), mirrored into (0, pi], unless ``table`` has it; return the number of roots."""
    if theta > math.pi:
        theta = 2 * math.pi - theta
    if theta > math.pi - AT_PI:
        theta = math.pi
    if theta <= 0.0 or depth <= 0.0 or filled >= table.shape[0]:
        return filled
    for k in range(filled):
        if abs(table[k, 0] - theta) < 1e-8 and abs(table[k, 1] - depth) < 1e-8 * depth:
            return filled
    table[filled, 0], table[filled, 1], table[filled, 2] = theta, depth, growth
    return filled + 1


@compiled
def _at_pi(series: Real, needed: Index, radius: float, depth: float, cell: Real, work: Real, out: Complex) -> float:
    """Compute F(pi, a), which is real, at one depth; ``cell`` is memory for two numbers."""
    theta, place = cell[:1], cell[1:]
    theta[0], place[0] = math.pi, depth
    values(series, needed, radius, theta, place, 1, work, out)
    return float(out[0].real)


@compiled
def _period_doubling(
    series: Real, needed: Index, radius: float, low: float, high: float, low_value: float, high_value: float
) -> tuple[float, float]:
    """Find the depth between ``low`` and ``high`` where F(pi, a) changes sign; also return the sign of the growth.

    The Illinois rule and Newton's method are used.
    """
    cell, out, work = np.empty(2), np.empty(1, dtype=np.complex128), workspace(series.shape[2], 1)
    bottom, top = low, high
    for _ in range(60):
        depth = low - low_value * (high - low) / (high_value - low_value)
        height = _at_pi(series, needed, radius, depth, cell, work, out)
        if height * high_value < 0.0:
            low, low_value = high, high_value
        else:
            low_value *= 0.5
        high, high_value = depth, height
        if abs(high - low) < 1e-6 * depth or high_value == 0.0:
            break
    # where rounding keeps the steps from vanishing, the last of them is still the better depth
    _, _, refined, growth = newton(series, radius, math.pi, high, top - bottom, top - bottom)
    return (refined if bottom <= refined <= top else high), growth


@compiled
def _dip(series: Real, needed: Index, radius: float, depths: Real, heights: Real) -> tuple[float, float]:
    """Find the depth where |F(pi, a)| is smallest, near three ``depths``; return depth and F(pi, a).

    At the three depths F has one sign, and |F| is smallest at the middle one; parabolas approximate the minimum. If
    the sign of F differs at the result, two close roots enclose it.
    """
    cell, out, work = np.empty(2), np.empty(1, dtype=np.complex128), workspace(series.shape[2], 1)
    a, b, c = depths[0], depths[1], depths[2]
    fa, fb, fc = heights[0], heights[1], heights[2]
    first = abs(fb)
    for trial in range(12):
        if trial == 4 and abs(fb) > 0.3 * first:
            break
        left, right = (b - a) * (fb - fc), (b - c) * (fb - fa)
        lowest = b - 0.5 * ((b - a) * left - (b - c) * right) / (left - right) if left != right else b
        if not a < lowest < c or abs(lowest - b) < 1e-3 * (c - a):
            lowest = b + 0.3 * (c - b) if c - b > b - a else b - 0.3 * (b - a)
        height = _at_pi(series, needed, radius, lowest, cell, work, out)
        if height * fb <= 0.0:
            return lowest, height
        if abs(height) < abs(fb):
            if lowest > b:
                a, fa, b, fb = b, fb, lowest, height
            else:
                c, fc, b, fb = b, fb, lowest, height
        elif lowest > b:
            c, fc = lowest, height
        else:
            a, fa = lowest, height
    return b, fb


@compiled
def period_doublings(
    series: Real, needed: Index, radius: float, depths: Real, heights: Real, table: Real, filled: int
) -> int:
    """Write the period doublings between depths at which F(pi, a) is known, including close pairs, to ``table``."""
    for k in range(1, len(depths)):
        if heights[k - 1] * heights[k] < 0.0:
            filled = _between(
                series, needed, radius, depths[k - 1], depths[k], heights[k - 1], heights[k], table, filled
            )
        elif k + 1 < len(depths) and heights[k] * heights[k + 1] > 0.0:
            low = min(abs(heights[k - 1]), abs(heights[k + 1]))
            if abs(heights[k]) > low:
                continue
            lowest, height = _dip(series, needed, radius, depths[k - 1 : k + 2], heights[k - 1 : k + 2])
            if height * heights[k] < 0.0:
                filled = _between(series, needed, radius, depths[k - 1], lowest, heights[k - 1], height, table, filled)
                filled = _between(series, needed, radius, lowest, depths[k + 1], height, heights[k + 1], table, filled)
    return filled


@compiled
def _between(
    series: Real,
    needed: Index,
    radius: float,
    low: float,
    high: float,
    low_value: float,
    high_value: float,
    table: Real,
    filled: int,
) -> int:
    """Add the period doubling between two depths."""
    depth, growth = _period_doubling(series, needed, radius, low, high, low_value, high_value)
    return keep(table, filled, math.pi, depth, growth)


@compiled
def turn(start: complex, end: complex) -> float:
    """Compute the angle from one complex number to another, -pi ... pi rad."""
    ratio = end * start.conjugate()
    return math.atan2(ratio.imag, ratio.real)


@compiled
def clear(start: complex, end: complex) -> bool:
    """Check whether the angle between two complex numbers is below 1.2 rad."""
    ratio = end * start.conjugate()
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
    """Put a cell, and F at its corners in anticlockwise order, on the stack."""
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
    table: Real,
    filled: int,
) -> tuple[int, float]:
    """Process a stack that holds one cell at first; return the number of roots and the resolved depth.

    Below the resolved depth (m) all cells were resolved; it is infinite if every cell was resolved.
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
            # in a cell without a root of its own a root next to it turns F along the edges
            reach = 0.6 if abs(winding) == 1 else 2.0
            good, root_theta, root_depth, growth = newton(
                series, radius, middle, height, reach * (high - low), reach * (top - bottom)
            )
            if good:
                filled = keep(table, filled, root_theta, root_depth, growth)
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
    table: Real,
) -> tuple[int, float]:
    """Write roots between the first and the last edge into rows (theta, depth, growth) of ``table``.

    The changes of the phase of F along the four edges of a cell are added: a sum of one whole turn means one root
    inside. A cell is split into four while the phase changes by more than 1.2 rad along an edge. At pi, where F is
    real, changes of its sign are period doublings. Roots in cells at pi are period doublings, too: two close roots do
    not change the sign.

    Return the number of roots (-1: F is lost in rounding), and the depth (m) below which all cells were resolved
    (infinite: every cell). With ``lowest`` the search stops above the row of cells with the lowest root.

    Parameters
    ----------
    edges : (n_rows + 1,), m
        Depths that bound the rows of cells, increasing.
    angles : (n_angles,), rad
        Edges of cells in theta, increasing, the last pi.
    table : (most, 3)
        Receives the roots.
    """
    count = len(angles)
    # the row's own depths, and one above, so that a minimum of |F| at the row's end is found
    lanes = count + STEPS_AT_PI + 1
    filled, resolved = 0, np.inf
    stack, corners = np.empty((256, 5)), np.empty((256, 4), dtype=np.complex128)
    work = workspace(series.shape[2], lanes)
    small = workspace(series.shape[2], 5)
    theta, depth = np.full(lanes, math.pi), np.full(lanes, edges[0])
    below, above = np.empty(lanes, dtype=np.complex128), np.empty(lanes, dtype=np.complex128)
    heights, depths = np.empty(STEPS_AT_PI + 2), np.empty(STEPS_AT_PI + 2)
    theta[:count] = angles
    # period doublings must lie inside cells, not on their edges
    theta[count - 1] += 0.37 * (theta[count - 1] - theta[count - 2])
    values(series, needed, radius, theta, depth, lanes, work, below)
    depths[0], heights[0] = edges[0], below[count].real
    for j in range(len(edges) - 1):
        bottom, top = edges[j], edges[j + 1]
        depth[:count] = top
        for k in range(STEPS_AT_PI + 1):
            depth[count + k] = min(bottom + (top - bottom) * (k + 1) / STEPS_AT_PI, radius / 2)
            depths[k + 1] = depth[count + k]
        values(series, needed, radius, theta, depth, lanes, work, above)
        if (above == 0).any():
            return -1, resolved
        heights[1:] = above[count:].real
        filled = period_doublings(series, needed, radius, depths, heights, table, filled)
        depths[0], heights[0] = top, heights[STEPS_AT_PI]
        for i in range(count - 1):
            f00, f10, f11, f01 = below[i], below[i + 1], above[i + 1], above[i]
            if clear(f00, f10) and clear(f10, f11) and clear(f11, f01) and clear(f01, f00):
                continue
            put(stack, corners, 0, theta[i], theta[i + 1], bottom, top, 0.0, f00, f10, f11, f01)
            filled, clear_below = search(series, needed, radius, stack, corners, small, table, filled)
            resolved = min(resolved, clear_below)
        if lowest and filled and table[:filled, 1].min() <= top:
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
    table: Real,
    resolved: Real,
) -> Index:
    """Find the roots (theta, depth, growth) at every speed, lowest first; -1 roots where F is lost in rounding.

    Parameters
    ----------
    table : (n_speeds, most, 3)
        Receives all roots, or only the lowest.
    resolved : (n_speeds,), m
        Receives the depths below which all cells were resolved.
    """
    counts = np.zeros(len(series), dtype=np.int64)
    for s in range(len(series)):
        first = np.empty((table.shape[1], 3))
        count, resolved[s] = roots(series[s], needed[s], radius, edges, angles[s], lowest, first)
        if count < 0:
            counts[s] = -1
            continue
        order = np.argsort(first[:count, 1])
        if lowest:
            order = order[:1]
        for row, k in enumerate(order):
            table[s, row] = first[k]
        counts[s] = len(order)
    return counts


@compiled(
    "(float64[:,:,:,:,::1], float64, int64[::1], float64[::1], float64[::1], float64[::1], float64[::1])",
)
def refined(finer: Real, radius: float, speed: Index, theta: Real, depth: Real, growth: Real, error: Real) -> None:
    """Refine roots with series of more nodes, ``finer``; the change of the depth is written to ``error``, m.

    ``theta``, ``depth`` and ``growth`` (n_roots,) are overwritten. If a root is not found again, its error is its
    depth.
    """
    for k in range(len(speed)):
        good, moved, final, there = newton(finer[speed[k]], radius, theta[k], depth[k], 0.1, 0.1 * depth[k])
        error[k] = depth[k]
        if good:
            error[k] = abs(final - depth[k]) + 1e-9 * final
            theta[k], depth[k], growth[k] = moved, final, there
