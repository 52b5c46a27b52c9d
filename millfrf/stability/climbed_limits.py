"""Lowest depth limits from Floquet multipliers alone, at depths that rise until a cut is unstable."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy

from millfrf.core import InputError, Real
from millfrf.cutting import edge_slices

from .floquet.crossings import largest_receptance, safe_depth
from .floquet.cut_period import check_edges, collocated_cut
from .floquet.growth import leading_multipliers
from .floquet.multipliers import kind_of
from .milling_loop import DelaySystem
from .settings import SETTINGS
from .solvers.collocation import strongest_force_line

# nodes a piece while a limit is bracketed, and to confirm it. With four fewer the multiplier of random cutters errs by
# 2 % at most up to 1.02, and stays above 1 beyond (`tests/stability/test_cutter_shapes.py`). Where offsets of the edges
# decide which pass left the surface, the force jumps inside pieces, and all nodes are needed.
FEWER_NODES, MORE_NODES = -4, 6


@dataclass(frozen=True)
class SpeedLimit:
    """Limit at one speed, with the values of `StabilityLobes`."""

    depth: float  # m; infinite: no limit up to the largest depth, NaN: not known
    frequency: float  # Hz
    kind: str
    status: str


UNRESOLVED = SpeedLimit(np.nan, np.nan, "none", "unresolved")


def ladder(first: float, top: float, ratio: float) -> Real:
    """Return depths from ``first`` to ``top`` (m) whose neighbours have the ratio ``ratio``; ``top`` is the last.

    Examples
    --------
    >>> ladder(1.0, 2.0, 1.5).tolist()
    [1.0, 1.5, 2.0]
    """
    if top <= first:
        return np.array([top])
    count = int(np.ceil(np.log(top / first) / np.log(ratio) - 1e-9))
    return np.append(first * ratio ** np.arange(count), top)


def climbed_limits(system: DelaySystem, speeds: Real, max_depth: float) -> list[SpeedLimit]:
    """Find and verify the lowest limit of any cutter at each speed (rad/s) up to ``max_depth`` (m).

    The depth rises from the small-gain depth in steps of 30 to 100 %, and in steps down to 1 % where the modulus of the
    largest multiplier may exceed 1 between two of them, so that islands of instability are found. A limit is verified
    if more nodes find it at the same depth; otherwise the highest stable depth is a lower bound.

    Raises
    ------
    InputError
        ``max_depth`` is above the cutter's last element, or two edges meet below it.
    """
    check_edges(system.process, max_depth)
    first = first_depth(system, max_depth)
    return [_climbed(system, float(speed), first, max_depth) for speed in speeds]


def first_depth(system: DelaySystem, max_depth: float) -> float:
    """Return a depth (m) below which every cut is stable by the small-gain theorem."""
    process = system.process
    if not process.profile:
        return min(safe_depth(system), max_depth)
    force = process.teeth * process.largest_stiffness
    widest = 0.25 / (force * largest_receptance(system))
    depth = max_depth
    while float(edge_slices(process, depth).widths.sum()) > widest:
        depth /= 1.5
    return depth


def _climbed(system: DelaySystem, speed: float, first: float, max_depth: float) -> SpeedLimit:
    """Search a limit with few nodes, and with all where it is not confirmed."""
    limit = UNRESOLVED
    for nodes in (0,) if system.process.has_offsets else (FEWER_NODES, 0):
        try:
            limit = _searched(system, speed, first, max_depth, nodes)
        except (InputError, np.linalg.LinAlgError):
            limit = UNRESOLVED
        if limit.status == "verified":
            break
    return limit


def _searched(system: DelaySystem, speed: float, first: float, max_depth: float, nodes: int) -> SpeedLimit:
    def growth(depth: float) -> float:
        return _growth(system, speed, depth, extra=nodes)

    def finer(depth: float) -> float:
        return _growth(system, speed, depth, extra=MORE_NODES)

    low, high = lowest_bracket(growth, first, max_depth)
    if low == 0.0:
        return UNRESOLVED
    if high == np.inf:
        return SpeedLimit(np.inf, np.nan, "none", "verified")
    exact = limit_between(lambda depth: _growth(system, speed, depth, tolerance=1e-9), low, high)
    if any(_confirmed(growth, finer, exact, margin) for margin in SETTINGS.margins):
        return _described(system, speed, exact)
    return SpeedLimit(low, np.nan, "none", "lower-bound")


def limit_between(growth: Callable[[float], float], low: float, high: float) -> float:
    """Return the depth (m) at which an exact growth is 0; ``low`` and ``high`` have a coarse one below and above 0.

    So near the limit that the exact growth has the other sign at an end, the end is the limit.
    """
    known = cache(growth)  # both ends are needed twice
    if known(low) >= 0:
        return low
    if known(high) <= 0:
        return high
    return float(scipy.optimize.brentq(known, low, high, xtol=1e-6 * high, rtol=1e-6))


def _confirmed(growth: Callable[[float], float], finer: Callable[[float], float], limit: float, margin: float) -> bool:
    """Check whether a finer discretisation has its limit within a share of this limit."""
    below, above = (1 - margin) * limit, (1 + margin) * limit
    # above the limit of a thin island the cut may be stable again
    return finer(below) < 0 and (finer(above) > 0 or growth(above) < 0)


def _growth(system: DelaySystem, speed: float, depth: float, *, extra: int = 0, tolerance: float = 1e-5) -> float:
    """Return the logarithm of the largest multiplier's modulus."""
    leading = leading_multipliers(collocated_cut(system, speed, depth, extra=extra), tolerance=tolerance)
    return float(np.log(max(leading.radius, 1e-300)))


@dataclass(frozen=True)
class _Point:
    """A depth (m) and the growth there."""

    depth: float
    growth: float

    def slope_to(self, other: "_Point") -> float:
        """Return the change of growth per relative change of depth."""
        return abs(other.growth - self.growth) / math.log(other.depth / self.depth)


def lowest_bracket(growth: Callable[[float], float], first: float, top: float) -> tuple[float, float]:
    """Return a stable depth (0: none) and the lowest unstable depth above it (infinite: none), m.

    Parameters
    ----------
    growth
        Logarithm of the largest multiplier's modulus at a depth (m).
    first, top : m
        Depths between which the limit is sought; cuts below ``first`` are stable.
    """
    last, slope = _Point(first, growth(first)), 0.0
    if last.growth >= 0:
        return 0.0, first
    while last.depth < top:
        depth = min(last.depth * _ratio(last.growth, slope), top)
        following = _Point(depth, growth(depth))
        if crossing := _first_crossing(growth, last, following, slope):
            return crossing
        last, slope = following, last.slope_to(following)
    return last.depth, np.inf


def _ratio(growth: float, slope: float) -> float:
    """Return the ratio of the next depth to the last, at which growth would reach 0 if it rose four times as fast.

    ``slope`` is the last change of growth per relative change of depth. Far below the limit, where the growth hardly
    changes, the depth is doubled.
    """
    until = -growth / (4 * slope) if slope > 0 else math.inf
    return math.exp(min(max(until, math.log(SETTINGS.ladder_ratio)), math.log(SETTINGS.largest_ratio)))


def _first_crossing(
    growth: Callable[[float], float], low: _Point, high: _Point, slope: float
) -> tuple[float, float] | None:
    """Return neighbouring depths with the lowest change from stable to unstable between two; None: no change.

    An interval is halved as long as the growth may reach zero inside it if it changes at most twice as fast as between
    its ends and in its neighbourhood, which has the ``slope`` (Piyavskii, USSR Comput. Math. Math. Phys. 12, 1972;
    Shubert, SIAM J. Numer. Anal. 9, 1972). Islands of instability thinner than 1 % may be missed.
    """
    width, steepest = math.log(high.depth / low.depth), max(slope, low.slope_to(high))
    largest = (low.growth + high.growth) / 2 + steepest * width
    if high.growth < 0 and (largest < 0 or width <= SETTINGS.thinnest_island):
        return None
    if width <= SETTINGS.thinnest_island:
        return low.depth, high.depth
    middle = math.sqrt(low.depth * high.depth)
    between = _Point(middle, growth(middle))
    lower = _first_crossing(growth, low, between, between.slope_to(high))
    if lower or between.growth >= 0:
        return lower
    return _first_crossing(growth, between, high, low.slope_to(between))


def _described(system: DelaySystem, speed: float, limit: float) -> SpeedLimit:
    """Add kind and frequency to a limit, from the multiplier on the unit circle."""
    cut = collocated_cut(system, speed, limit)
    leading = leading_multipliers(cut)
    value = complex(leading.values[0])
    frequency = strongest_force_line(system, cut, value, leading.vectors[:, 0])
    return SpeedLimit(limit, frequency, kind_of(value), "verified")
