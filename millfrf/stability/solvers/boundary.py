"""The boundary of stability followed over speed to a stated tolerance, and the grid for those who want one."""

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

Solver = Callable[[Frf | ModalModel, MillingProcess, Real, float], StabilityLimits]
"""Such as :func:`collocation_limits` or :func:`multi_frequency_limits`."""

NARROWEST = 1e-4
"""Where boundaries begin, end or cross, speeds are brought together to this share of themselves."""


@dataclass(frozen=True)
class StabilityBoundary:
    """The boundary as points so close that straight lines between them are right.

    Parameters
    ----------
    limits
        The lowest crossing at each speed that was needed, or all crossings where ``every_limit`` was asked for.
    tolerance
        Largest bend of the lowest limit away from a straight line between neighbouring speeds, as a share of the limit.
        Jumps and corners are excepted; they are known in speed to 1e-4 of themselves.
    evaluations
        Number of speeds that were solved for.
    """

    limits: StabilityLimits
    tolerance: float
    evaluations: int

    @property
    def lobes(self) -> StabilityLobes:
        """The lowest limit over speed."""
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
    """Follow the boundary between two speeds, with speeds only where they are needed.

    Intervals are halved while their middle lies off the straight line by more than the tolerance, or while their ends
    do not have the same limits (an island begins, a lobe passes through another).

    Parameters
    ----------
    structure, process
        Structure at the tool tip and cut, as the solver takes them.
    lowest_speed, highest_speed : rad/s
        Spindle speeds between which the boundary is followed.
    max_depth : m
        Largest axial depth that is searched.
    tolerance
        Largest error of a depth between two speeds, as a share of the depth.
    every_limit
        Hold all limits to the tolerance, not the lowest alone: islands are then drawn as finely.
    solver
        Function that gives all limits at given speeds; collocation looks for the lowest alone unless all are wanted.
    threads
        Number of threads of collocation; None: one a core.

    Raises
    ------
    InputError
        Speeds not positive and increasing, a tolerance that is not between 0 and 1, or what the solver refuses.
    """
    if not (0 < lowest_speed < highest_speed and np.isfinite(highest_speed)):
        raise InputError(
            f"speeds {lowest_speed:g} to {highest_speed:g} rad/s are not positive and increasing; "
            "give the lower one first"
        )
    if not 0 < tolerance < 1:
        raise InputError(f"tolerance {tolerance!r} of depth is not between 0 and 1; 1e-3 is a good one")
    first = np.geomspace(lowest_speed, highest_speed, _first_count(structure, process, lowest_speed, highest_speed))
    lowest = solver is collocation_limits and not every_limit
    threads = threads or os.cpu_count() or 1

    def solved(speeds: Real) -> StabilityLimits:
        if lowest:
            return lowest_limits(structure, process, speeds, max_depth, threads=threads)
        if solver is collocation_limits:
            return collocation_limits(structure, process, speeds, max_depth, threads=threads)
        return solver(structure, process, speeds, max_depth)

    limits = solved(first)
    waiting = np.column_stack([first[:-1], first[1:]])
    while len(waiting):
        middle = waiting.mean(axis=1)
        limits = joined(limits, solved(middle))
        straight = _straight(limits, waiting, middle, tolerance, every_limit)
        wide = waiting[:, 1] - waiting[:, 0] > NARROWEST * waiting[:, 1]
        left, right = waiting.copy(), waiting.copy()
        left[:, 1] = right[:, 0] = middle
        waiting = np.concatenate([half[~straight & wide] for half in (left, right)])
    return StabilityBoundary(limits, tolerance, len(limits.spindle_speeds))


def _first_count(structure: Frf | ModalModel, process: MillingProcess, lowest: float, highest: float) -> int:
    """Six speeds a lobe of the structure's middle frequency, at least 24."""
    if isinstance(structure, ModalModel):
        typical = float(np.median(structure.natural_frequencies)) if len(structure.poles) else 1.0
    else:
        typical = float(np.median(structure.frequencies)) if len(structure.frequencies) else 1.0
    lobes = 2 * np.pi * typical / process.teeth * (1 / lowest - 1 / highest)
    return int(np.clip(np.ceil(6 * lobes), 24, 600))


def joined(one: StabilityLimits, other: StabilityLimits) -> StabilityLimits:
    """Limits of two sets of speeds as one, speeds increasing."""
    speeds = np.concatenate([one.spindle_speeds, other.spindle_speeds])
    order = np.argsort(speeds, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    owner = place[np.concatenate([one.speed, other.speed + len(one.spindle_speeds)])]
    depth = np.concatenate([one.depth, other.depth])
    rows = np.lexsort([depth, owner])
    kinds = one.bifurcation + other.bifurcation
    return replace(
        one,
        spindle_speeds=speeds[order],
        speed=owner[rows],
        depth=depth[rows],
        frequency=np.concatenate([one.frequency, other.frequency])[rows],
        bifurcation=tuple(kinds[row] for row in rows),
        change=np.concatenate([one.change, other.change])[rows],
        error=np.concatenate([one.error, other.error])[rows],
        warnings=tuple(dict.fromkeys(one.warnings + other.warnings)),
        resolved=np.concatenate([one.resolved, other.resolved])[order],
    )


def _straight(
    limits: StabilityLimits, intervals: Real, middle: Real, tolerance: float, every_limit: bool
) -> NDArray[np.bool_]:
    """Whether the limits at the middles lie on the straight lines between those at the ends."""
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
        one, other, here = limits.depth[rows].T
        # halving divides the error of straight lines by four; 2.5 leaves room where they bend unevenly
        bent = np.abs(here - (one + other) / 2) > 2.5 * tolerance * here
        apart = np.maximum(np.abs(one - here), np.abs(other - here)) > tolerance * here
        changed = (kinds[rows] != kinds[rows[:, :1]]).any(axis=1)
        result[compared] &= ~((bent | changed) & apart)
    return np.asarray(result)


@dataclass(frozen=True)
class StabilityGrid:
    """Stable or not on a grid of cuts.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the grid.
    depths : (n_depths,), m
        Axial depths of the grid.
    unstable_multipliers : (n_speeds, n_depths)
        Number of Floquet multipliers outside the unit circle; zero where the cut is stable.
    limits
        The limits from which the grid was filled.
    """

    spindle_speeds: Real
    depths: Real
    unstable_multipliers: Index
    limits: StabilityLimits

    @property
    def stable(self) -> NDArray[np.bool_]:
        """(n_speeds, n_depths), True where the cut is stable."""
        return np.asarray(self.unstable_multipliers == 0)


def stability_grid(
    model: ModalModel, process: MillingProcess, spindle_speeds: Real, depths: Real, *, threads: int | None = None
) -> StabilityGrid:
    """Stability on a grid: all limits at each speed, then the depths between them, in parallel over speeds.

    Parameters
    ----------
    model, process
        Modal model at the tool tip and cut, as :func:`collocation_limits` takes them.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the grid.
    depths : (n_depths,), m
        Axial depths of the grid, zero or more.
    threads
        Number of threads over which the speeds are spread; None: one a core.

    Raises
    ------
    InputError
        A negative depth, speeds that are not positive, or what :func:`collocation_limits` refuses.
    """
    depths = np.atleast_1d(np.asarray(depths, dtype=float))
    if depths.size == 0 or not (np.isfinite(depths).all() and depths.min() >= 0 and depths.max() > 0):
        raise InputError(f"depths {depths.min() if depths.size else 'none'} m ... must be zero or more, one above zero")
    speeds = checked_speeds(spindle_speeds, float(depths.max()))
    limits = collocation_limits(model, process, speeds, float(depths.max()), threads=threads or os.cpu_count() or 1)
    return StabilityGrid(speeds, depths, limits.unstable_multipliers(depths), limits)
