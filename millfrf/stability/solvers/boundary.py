"""The boundary of stability traced over speed to a stated tolerance, and stability on a grid of cuts."""

import os
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Index, InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from ..lobes_result import StabilityLimits, StabilityLobes
from .collocation import collocation_limits, lowest_limits
from .zero_order import checked_speeds

# such as `collocation_limits` or `multi_frequency_limits`
Solver = Callable[[Frf | ModalModel, MillingProcess, Real, float], StabilityLimits]


@dataclass(frozen=True)
class StabilityBoundary:
    """Boundary of stability at speeds so close that straight lines between its points are within ``tolerance``.

    Jumps and corners are excepted; their speeds are known with a relative error of 1e-4.
    """

    limits: StabilityLimits  # lowest crossing at each speed, or all crossings with ``every_limit``
    tolerance: float  # largest deviation of the lowest limit from straight lines between speeds, as a share
    evaluations: int  # number of speeds that were solved for

    @property
    def lobes(self) -> StabilityLobes:
        """Return the lowest limit at each speed."""
        return self.limits.lowest()


def trace_boundary(
    structure: Frf | ModalModel,
    process: MillingProcess,
    lowest_speed: float,
    highest_speed: float,
    max_depth: float,
    *,
    tolerance: float = 1e-3,
    every_limit: bool = False,
    solver: Solver = collocation_limits,
    threads: int | None = None,
) -> StabilityBoundary:
    """Trace the boundary between two speeds, with as few speeds as the tolerance requires.

    An interval is halved if the limit in its middle deviates from the straight line by more than the tolerance, or if
    its ends have different sets of limits (an island begins, two lobes cross). Speeds are in rad/s, the largest depth
    in m. The tolerance is a share of the depth; with ``every_limit`` it holds for all limits, islands included.
    """
    if not (0 < lowest_speed < highest_speed and np.isfinite(highest_speed)):
        raise InputError(
            f"speeds {lowest_speed:g} to {highest_speed:g} rad/s are not positive and increasing; "
            "give the lower one first"
        )
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance {tolerance!r} of depth is not between 0 and 1; 1e-3 is a good one")
    first = np.geomspace(lowest_speed, highest_speed, _first_count(structure, process, lowest_speed, highest_speed))
    threads = threads or os.cpu_count() or 1

    def solved(speeds: Real) -> StabilityLimits:
        if solver is not collocation_limits:
            return solver(structure, process, speeds, max_depth)
        limits_at = collocation_limits if every_limit else lowest_limits
        return limits_at(structure, process, speeds, max_depth, threads=threads)

    limits = solved(first)
    intervals = np.column_stack([first[:-1], first[1:]])
    while len(intervals):
        middle = intervals.mean(axis=1)
        limits = joined(limits, solved(middle))
        straight = _straight(limits, intervals, middle, tolerance, every_limit)
        # where boundaries begin, end or cross, halving ends at a relative distance of 1e-4
        wide = intervals[:, 1] - intervals[:, 0] > 1e-4 * intervals[:, 1]
        left, right = intervals.copy(), intervals.copy()
        left[:, 1] = right[:, 0] = middle
        intervals = np.concatenate([half[~straight & wide] for half in (left, right)])
    return StabilityBoundary(limits, tolerance, len(limits.spindle_speeds))


def _first_count(structure: Frf | ModalModel, process: MillingProcess, lowest: float, highest: float) -> int:
    """Return the first number of speeds: six per lobe of the structure's median frequency, from 24 to 600."""
    if isinstance(structure, ModalModel):
        typical = float(np.median(structure.natural_frequencies)) if len(structure.poles) else 1.0
    else:
        typical = float(np.median(structure.frequencies)) if len(structure.frequencies) else 1.0
    lobes = 2 * np.pi * typical / process.teeth * (1 / lowest - 1 / highest)
    return int(np.clip(np.ceil(6 * lobes), 24, 600))


def joined(first: StabilityLimits, second: StabilityLimits) -> StabilityLimits:
    """Merge the limits of two sets of speeds, in order of increasing speed."""
    speeds = np.concatenate([first.spindle_speeds, second.spindle_speeds])
    order = np.argsort(speeds, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    owner = place[np.concatenate([first.speed, second.speed + len(first.spindle_speeds)])]
    depth = np.concatenate([first.depth, second.depth])
    rows = np.lexsort([depth, owner])
    kinds = first.bifurcation + second.bifurcation
    return replace(
        first,
        spindle_speeds=speeds[order],
        speed=owner[rows],
        depth=depth[rows],
        frequency=np.concatenate([first.frequency, second.frequency])[rows],
        bifurcation=tuple(kinds[row] for row in rows),
        change=np.concatenate([first.change, second.change])[rows],
        error=np.concatenate([first.error, second.error])[rows],
        warnings=tuple(dict.fromkeys(first.warnings + second.warnings)),
        resolved=np.concatenate([first.resolved, second.resolved])[order],
    )


def _straight(
    limits: StabilityLimits, intervals: Real, middle: Real, tolerance: float, every_limit: bool
) -> NDArray[np.bool_]:
    """Check whether limits in the middle of intervals lie on straight lines between the limits at the ends."""
    begins = np.searchsorted(limits.speed, np.arange(len(limits.spindle_speeds) + 1))
    places = np.searchsorted(limits.spindle_speeds, np.column_stack([intervals, middle]))
    counts = np.diff(begins)[places]
    if not every_limit:
        counts = np.minimum(counts, 1)
    result = (counts == counts[:, :1]).all(axis=1)
    kinds = np.array(limits.bifurcation)
    for k in range(int(counts[result].max(initial=0))):
        compared = np.flatnonzero(result & (counts[:, 0] > k))
        rows = begins[places[compared]] + k
        low_end, high_end, between = limits.depth[rows].T
        # halving divides the error of straight lines by four; 2.5 leaves a margin for uneven curvature
        bent = np.abs(between - (low_end + high_end) / 2) > 2.5 * tolerance * between
        different = np.maximum(np.abs(low_end - between), np.abs(high_end - between)) > tolerance * between
        changed = (kinds[rows] != kinds[rows[:, :1]]).any(axis=1)
        result[compared] &= ~((bent | changed) & different)
    return np.asarray(result)


@dataclass(frozen=True)
class StabilityGrid:
    """Stability on a grid of cuts."""

    spindle_speeds: Real  # (n_speeds,), rad/s
    depths: Real  # (n_depths,), m
    unstable_multipliers: Index  # (n_speeds, n_depths): number outside the unit circle; zero where the cut is stable
    limits: StabilityLimits  # from which the grid was filled

    @property
    def stable(self) -> NDArray[np.bool_]:
        """Return a mask (n_speeds, n_depths) that is true where the cut is stable."""
        return np.asarray(self.unstable_multipliers == 0)


def stability_grid(
    model: ModalModel, process: MillingProcess, spindle_speeds: Real, depths: Real, *, threads: int | None = None
) -> StabilityGrid:
    """Compute stability on a grid of spindle speeds (rad/s) and depths (m), in parallel over speeds."""
    depths = np.atleast_1d(np.asarray(depths, dtype=float))
    if depths.size == 0 or not (np.isfinite(depths).all() and depths.min() >= 0 and depths.max() > 0):
        raise InputError(f"depths {depths.min() if depths.size else 'none'} m ... must be zero or more, one above zero")
    speeds = checked_speeds(spindle_speeds, float(depths.max()))
    limits = collocation_limits(model, process, speeds, float(depths.max()), threads=threads or os.cpu_count() or 1)
    return StabilityGrid(speeds, depths, limits.unstable_multipliers(depths), limits)
