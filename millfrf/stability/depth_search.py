"""Search of the lowest depth at which a cut becomes unstable, from the growth of a small deviation at some depths."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy

from .settings import SETTINGS

REACH = 0.62  # of the way to the predicted limit: of a growth that rises evenly, `_free` holds up to 0.66
CLOSE = 1e-6  # relative step after which a limit has converged


@dataclass(frozen=True)
class Point:
    """A depth (m), and the logarithm of the largest multiplier's modulus there."""

    depth: float
    growth: float

    def slope_to(self, other: "Point") -> float:
        """Return the change of growth per relative change of depth."""
        return (other.growth - self.growth) / math.log(other.depth / self.depth)

    def limit_by(self, other: "Point") -> float:
        """Return the depth (m) at which the straight line through the growth at both is 0; infinite: it falls."""
        rise = (other.growth - self.growth) / (other.depth - self.depth)
        return self.depth - self.growth / rise if rise > 0 else math.inf

    def close_to(self, other: "Point") -> bool:
        """Check whether no island of instability is sought between this depth and a larger one."""
        return other.depth <= (1 + SETTINGS.thinnest_island) * self.depth * (1 + 1e-9)


def lowest_bracket(growth: Callable[[float], float], first: float, top: float) -> tuple[Point, Point]:
    """Return a stable depth (0: none) and the lowest unstable depth above it (infinite: none).

    The depth rises by at most a factor of 2. An interval between two stable depths counts as stable if the growth does
    not reach zero in it even if it changes at most twice as fast as between its ends and in its neighbourhood, or if it
    is thinner than 1 % (Piyavskii, USSR Comput. Math. Math. Phys. 12, 1972; Shubert, SIAM J. Numer. Anal. 9, 1972).
    Islands of instability that are thinner may be missed.

    Parameters
    ----------
    growth
        Logarithm of the largest multiplier's modulus at a depth (m).
    first, top : m
        Depths between which the limit is sought; cuts below ``first`` are stable.
    """
    low, below = Point(first, growth(first)), None
    if low.growth >= 0:
        return Point(0.0, -math.inf), low
    ahead: list[Point] = []  # known depths above, the lowest last
    while ahead or low.depth < top:
        if ahead:
            high = ahead[-1]
            if high.growth >= 0 and low.close_to(high):
                return low, high
            if _free(low, high, below, ahead[-2] if len(ahead) > 1 else None):
                low, below = ahead.pop(), low
                continue
            depth = _inside(low, high, below)
        else:
            depth = min(_above(low, below), top)
        ahead.append(Point(depth, growth(depth)))
    return low, Point(math.inf, math.nan)


def _free(low: Point, high: Point, below: Point | None, above: Point | None) -> bool:
    """Check whether no depth between two is unstable if the growth changes at most twice as fast as around them."""
    slopes = [low.slope_to(high), below.slope_to(low) if below else 0.0, high.slope_to(above) if above else 0.0]
    largest = (low.growth + high.growth) / 2 + float(np.abs(slopes).max()) * math.log(high.depth / low.depth)
    return high.growth < 0 and (largest < 0 or low.close_to(high))


def _above(low: Point, below: Point | None) -> float:
    """Return the next depth (m) above all that are known."""
    limit = below.limit_by(low) if below else math.inf
    depth = low.depth + REACH * (limit - low.depth)
    return min(max(depth, low.depth * (1 + SETTINGS.thinnest_island)), low.depth * SETTINGS.largest_ratio)


def _inside(low: Point, high: Point, below: Point | None) -> float:
    """Return a depth (m) between two."""
    width = high.depth - low.depth
    if width <= 2 * SETTINGS.thinnest_island * low.depth:
        return low.depth + width / 2
    if high.growth < 0:  # the size of the growth falls by equal factors
        return low.depth + width * min(max(1 / (1 + math.sqrt(high.growth / low.growth)), 1 - REACH), REACH)
    limits = [low.limit_by(high), *([below.limit_by(low)] if below else [])]
    until = min(float(np.mean(limits)), high.depth) - low.depth
    if until < 0.75 * SETTINGS.thinnest_island * low.depth:  # a depth above the limit ends the search
        return low.depth * (1 + SETTINGS.thinnest_island)
    return low.depth + min(max(REACH * until, width / 4), REACH * width)


def limit_between(growth: Callable[[float], float], low: Point, high: Point) -> float:
    """Return the depth (m) at which an exact growth is 0; ``low`` and ``high`` have a coarse one below and above 0.

    So near the limit that the exact growth has the other sign at an end, the end is the limit.
    """
    known, last = cache(growth), low
    slope, depth = (high.growth - low.growth) / (high.depth - low.depth), low.limit_by(high)
    for _ in range(8):  # the secant method
        point = Point(depth, known(depth))
        if last is not low:
            slope = (point.growth - last.growth) / (point.depth - last.depth)
        if not slope > 0:
            break
        last, depth = point, min(max(point.depth - point.growth / slope, low.depth), high.depth)
        if abs(depth - last.depth) <= CLOSE * depth:
            return depth
    if known(low.depth) >= 0:
        return low.depth
    if known(high.depth) <= 0:
        return high.depth
    return float(scipy.optimize.brentq(known, low.depth, high.depth, xtol=CLOSE * high.depth, rtol=CLOSE))
