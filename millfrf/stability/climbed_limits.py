"""Lowest depth limits from Floquet multipliers alone, at depths that rise until a cut is unstable."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError, Real
from millfrf.cutting import table_height, whole_slices

from .depth_search import limit_between, lowest_bracket
from .floquet.crossings import largest_receptance
from .floquet.cut_layout import least_angle
from .floquet.cut_period import CollocatedCut, collocated_cut
from .floquet.growth import LeadingMultipliers, leading_multipliers
from .floquet.multipliers import kind_of
from .milling_loop import DelaySystem
from .settings import SETTINGS
from .solvers.collocation import strongest_force_line

MORE_NODES = 6  # in each piece, to confirm a limit
LARGEST_GAIN = 0.9  # of the loop, below 1, as the largest receptance is taken on a grid


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
    first = first_depth(system, max_depth)
    return [_climbed(system, float(speed), first, max_depth) for speed in speeds]


def first_depth(system: DelaySystem, max_depth: float) -> float:
    """Return a depth (m) below which every cut is stable by the small-gain theorem.

    A force F moves the chip of a slice by at most ``sin kappa |H_xy| + |cos kappa| |H_z|`` times F, now and when the
    surface was left; the tip of a ball, which cuts along Z, does not feel X and Y. The force is that of all teeth that
    cut at the same height at once. A surface is cut only once, so that no motion acts on more teeth at a time.
    """
    process, whole = system.process, whole_slices(system.process, table_height(max_depth), 1)
    plane, axis = largest_receptance(system, (0, 1)), largest_receptance(system, (2,))
    sine, cosine = (np.abs(function(whole.slices.edge_angles)).max(axis=1) for function in (np.sin, np.cos))
    # at an edge angle alone the depth counts as the edge's width, except in turning
    widths = whole.slices.widths / (sine if process.is_turning and not process.profile else 1.0)
    at_once = np.ceil((whole.slices.exits - whole.slices.starts).max() / least_angle(process, max_depth) - 1e-9)
    teeth = min(max(float(at_once), 1.0), process.teeth)
    gains = 2 * teeth * process.largest_stiffness * widths * (sine * plane + cosine * axis)
    before = np.cumsum(gains) - gains
    last = int(np.searchsorted(before, LARGEST_GAIN)) - 1
    low, high = whole.lengths[last]
    element, base = whole.elements[last]
    share = min(1.0, (LARGEST_GAIN - before[last]) / gains[last])
    return min(base + element.rise(float(low + share * (high - low))), max_depth)


def _climbed(system: DelaySystem, speed: float, first: float, max_depth: float) -> SpeedLimit:
    """Search a limit with coarse nodes, and with all where it is not confirmed.

    With coarse nodes the multiplier of random cutters errs by 2 % at most up to 1.02, and stays above 1 beyond
    (`tests/stability/test_cutter_shapes.py`). Where offsets of the edges decide which pass left the surface, the force
    jumps inside pieces, and all nodes are needed.
    """
    limit = UNRESOLVED
    for coarse in (False,) if system.process.has_offsets else (True, False):
        try:
            limit = _searched(system, speed, first, max_depth, coarse)
        except (InputError, np.linalg.LinAlgError):
            limit = UNRESOLVED
        if limit.status == "verified":
            break
    return limit


def _searched(system: DelaySystem, speed: float, first: float, max_depth: float, coarse: bool) -> SpeedLimit:
    def growth(depth: float) -> float:
        return _growth(system, speed, depth, coarse=coarse)

    def finer(depth: float) -> float:
        return _growth(system, speed, depth, extra=MORE_NODES)

    def exact(depth: float) -> float:
        cut = collocated_cut(system, speed, depth)
        solved.append((cut, leading_multipliers(cut)))
        return _logarithm(solved[-1][1])

    solved: list[tuple[CollocatedCut, LeadingMultipliers]] = []
    low, high = lowest_bracket(growth, first, max_depth)
    if low.depth == 0.0:
        return UNRESOLVED
    if high.depth == np.inf:
        return SpeedLimit(np.inf, np.nan, "none", "verified")
    limit = limit_between(exact, low, high)
    if any(_confirmed(growth, finer, limit, margin) for margin in SETTINGS.margins):
        return _described(system, *solved[-1], limit)
    return SpeedLimit(low.depth, np.nan, "none", "lower-bound")


def _confirmed(growth: Callable[[float], float], finer: Callable[[float], float], limit: float, margin: float) -> bool:
    """Check whether a finer discretisation has its limit within a share of this limit."""
    below, above = (1 - margin) * limit, (1 + margin) * limit
    # above the limit of a thin island the cut may be stable again
    return finer(below) < 0 and (finer(above) > 0 or growth(above) < 0)


def _growth(system: DelaySystem, speed: float, depth: float, *, extra: int = 0, coarse: bool = False) -> float:
    """Return the logarithm of the largest multiplier's modulus to five digits."""
    cut = collocated_cut(system, speed, depth, extra=extra, coarse=coarse)
    return _logarithm(leading_multipliers(cut, tolerance=1e-5))


def _logarithm(leading: LeadingMultipliers) -> float:
    return math.log(max(leading.radius, 1e-300))


def _described(system: DelaySystem, cut: CollocatedCut, leading: LeadingMultipliers, limit: float) -> SpeedLimit:
    """Add kind and frequency to a limit, from the multiplier of a cut beside it."""
    value = complex(leading.values[0])
    frequency = strongest_force_line(system, cut, value, leading.vectors[:, 0])
    return SpeedLimit(limit, frequency, kind_of(value), "verified")
