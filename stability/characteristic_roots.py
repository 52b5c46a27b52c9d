"""All roots (theta, depth) of the characteristic function, by winding numbers on cells; compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from cutting.compiled import compiled

from .characteristic import newton, values, workspace

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]

DOUBLINGS = 8
"""Depths a row of cells at which the real F(pi, a) is looked at."""


@compiled
def turn(one: complex, other: complex) -> float:
    """Angle from one complex number to another, -pi ... pi."""
    ratio = other * one.conjugate()
    return math.atan2(ratio.imag, ratio.real)


@compiled
def _clear(one: complex, other: complex) -> bool:
    """Whether one complex number is turned by less than 1.2 rad from another."""
    ratio = other * one.conjugate()
    return abs(ratio.imag) < 2.572 * ratio.real


@compiled
def _period_doubling(
    series: Real, needed: Index, radius: float, low: float, high: float, low_value: float, high_value: float
) -> tuple[float, float]:
    """Depth between two where the real F(pi, a) changes sign, by the Illinois rule and Newton's; sign of its growth."""
    theta, depth = np.full(1, math.pi), np.empty(1)
    out, work = np.empty(1, dtype=np.complex128), workspace(series.shape[2], 1)
    bottom, top = low, high
    for _ in range(60):
        depth[0] = low - low_value * (high - low) / (high_value - low_value)
        values(series, needed, radius, theta, depth, 1, work, out)
        if out[0].real * high_value < 0.0:
            low, low_value = high, high_value
        else:
            low_value *= 0.5
        high, high_value = depth[0], out[0].real
        if abs(high - low) < 1e-6 * radius or high_value == 0.0:
            break
    _, _, refined, growth = newton(series, radius, math.pi, high, top - bottom, top - bottom)
    return refined, growth


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
    series: Real,
    needed: Index,
    radius: float,
    max_depth: float,
    angles: Real,
    rows: int,
    lowest: bool,
    found: Real,
) -> int:
    """Write roots below ``max_depth`` into rows (theta, depth, growth) of ``found``; return how many, -1 if F is lost.

    On each cell the turns of F along the four edges are added: a sum of one whole turn is one root inside. Cells with
    edges that turn by more than 1.2 rad are split into four until they are clear. At pi, where F is real, its changes
    of sign are period doublings.

    Parameters
    ----------
    series, needed, radius
        Of one speed, as for :func:`values`.
    angles : (n_angles,), rad
        First edges of cells in theta, increasing, the last pi.
    rows
        First number of cells in depth.
    lowest
        Stop above the row of cells with the lowest root.
    found : (most, 3)
        Receives the roots.
    """
    count = len(angles)
    lanes = count + DOUBLINGS
    filled = 0
    stack, corners = np.empty((256, 5)), np.empty((256, 4), dtype=np.complex128)
    work = workspace(series.shape[2], lanes)
    small = workspace(series.shape[2], 5)
    theta, depth = np.full(lanes, math.pi), np.zeros(lanes)
    below, above = np.empty(lanes, dtype=np.complex128), np.empty(lanes, dtype=np.complex128)
    theta[:count] = angles
    # period doublings shall lie inside cells, not on their edges
    theta[count - 1] += 0.37 * (theta[count - 1] - theta[count - 2])
    values(series, needed, radius, theta, depth, lanes, work, below)
    for j in range(rows):
        bottom, top = max_depth * (j / rows) ** 1.5, max_depth * ((j + 1) / rows) ** 1.5
        for k in range(lanes):
            depth[k] = top if k < count else bottom + (top - bottom) * (k - count + 1) / DOUBLINGS
        values(series, needed, radius, theta, depth, lanes, work, above)
        if (above == 0).any():
            return -1
        before, step = below[lanes - 1].real, (top - bottom) / DOUBLINGS
        for k in range(count, lanes):
            here = above[k].real
            if before * here < 0.0 and filled < len(found):
                found[filled, 0] = math.pi
                found[filled, 1], found[filled, 2] = _period_doubling(
                    series, needed, radius, depth[k] - step, depth[k], before, here
                )
                filled += 1
            before = here
        for i in range(count - 1):
            f00, f10, f11, f01 = below[i], below[i + 1], above[i + 1], above[i]
            if _clear(f00, f10) and _clear(f10, f11) and _clear(f11, f01) and _clear(f01, f00):
                continue
            _put(stack, corners, 0, theta[i], theta[i + 1], bottom, top, 0.0, f00, f10, f11, f01)
            filled = _search(series, needed, radius, stack, corners, small, found, filled)
        if lowest and filled and found[:filled, 1].min() <= top:
            break
        below, above = above, below
    return filled


@compiled
def _search(
    series: Real,
    needed: Index,
    radius: float,
    stack: Real,
    corners: Complex,
    work: Real,
    found: Real,
    filled: int,
) -> int:
    """Work off a stack of cells that holds one to begin with."""
    theta, depth, out = np.empty(5), np.empty(5), np.empty(5, dtype=np.complex128)
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
            good, root_theta, root_depth, growth = newton(
                series, radius, middle, height, 0.6 * (high - low), 0.6 * (top - bottom)
            )
            if good:
                filled = _keep(found, filled, root_theta, root_depth, growth, radius)
                continue
        if level >= 12 or (winding == 0 and level >= 6) or depth_of_stack + 4 > len(stack):
            continue
        theta[0], theta[1], theta[2], theta[3], theta[4] = middle, middle, middle, low, high
        depth[0], depth[1], depth[2], depth[3], depth[4] = height, bottom, top, height, height
        values(series, needed, radius, theta, depth, 5, work, out)
        centre, south, north, west, east = out[0], out[1], out[2], out[3], out[4]
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
    series: Real,
    finer: Real,
    needed: Index,
    radius: float,
    max_depth: float,
    angles: Real,
    rows: int,
    lowest: bool,
    found: Real,
) -> Index:
    """Roots at every speed, refined on series with more nodes: (theta, depth, growth, error), lowest first.

    Parameters
    ----------
    series, needed, angles
        One row a speed, otherwise as for :func:`roots`.
    finer
        As ``series``; what it changes is the error.
    found : (n_speeds, most, 4)
        Receives the roots; all of them, or the lowest alone.

    Returns
    -------
    (n_speeds,)
        How many; -1 where the characteristic function is lost in rounding.
    """
    counts = np.zeros(len(series), dtype=np.int64)
    for s in range(len(series)):
        first = np.empty((found.shape[1], 3))
        count = roots(series[s], needed[s], radius, max_depth, angles[s], rows, lowest, first)
        if count < 0:
            counts[s] = -1
            continue
        order = np.argsort(first[:count, 1])
        if lowest:
            order = order[:1]
        for row, k in enumerate(order):
            theta, depth, growth = first[k, 0], first[k, 1], first[k, 2]
            good, moved, final, growth_there = newton(finer[s], radius, theta, depth, 0.1, 0.1 * depth)
            if good:
                found[s, row, 0], found[s, row, 1], found[s, row, 2] = moved, final, growth_there
                found[s, row, 3] = abs(final - depth) + 1e-9 * final
            else:
                found[s, row, 0], found[s, row, 1], found[s, row, 2], found[s, row, 3] = theta, depth, growth, depth
        counts[s] = len(order)
    return counts
