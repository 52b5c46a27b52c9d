"""Period doublings: roots of the real F(pi, a), close pairs included; compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from cutting.compilation import compiled

from .characteristic import newton, values, workspace

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
Index = NDArray[np.int64]

AT_PI = 1e-6
"""Roots nearer to pi than this are at pi, rad."""


@compiled
def keep(found: Real, filled: int, theta: float, depth: float, growth: float) -> int:
    """Add a root (theta, depth, growth), mirrored into (0, pi], unless it is there; return how many there are."""
    if theta > math.pi:
        theta = 2 * math.pi - theta
    if theta > math.pi - AT_PI:
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
