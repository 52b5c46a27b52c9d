"""Roots (theta, depth) of the characteristic function in cells, by winding numbers; compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from cutting.compilation import compiled

from .characteristic import newton, values
from .period_doublings import keep

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]

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


@compiled
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
