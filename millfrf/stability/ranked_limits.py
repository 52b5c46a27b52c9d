"""Ranks of the limits of drawn structures, such as the lowest and the highest, found by multipliers alone."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Index, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from .floquet.multipliers import unstable_cuts
from .milling_loop import DelaySystem, delay_system
from .settings import SETTINGS


def unstable_at(system: DelaySystem, speeds: Real, depths: Real) -> NDArray[np.bool_]:
    """Return which cuts of the depths (n_speeds, n_depths), m, are unstable."""
    return unstable_cuts(system, np.repeat(speeds, depths.shape[1]), depths.ravel()).reshape(depths.shape)


@dataclass(frozen=True)
class RankedLimits:
    """Limits of several structures, each the lowest over some speeds, sorted into steps of depth.

    A limit in the middle of the sorted ones is never computed: the interval of a rank is halved by counting how many
    structures are unstable at its middle, and only those whose limit may have this rank are tried again. Multipliers
    at one depth take a sixtieth of the time of a limit.

    Parameters
    ----------
    systems
        Structure and cut of each draw.
    speeds : (n_speeds,), rad/s
        A cut is unstable if it is at one of these.
    steps : (n_steps,), m
        Rising depths; a structure that is unstable only between two of them counts as stable there.
    first : (n_draws,)
        Number of the lowest step at which each structure is unstable; n_steps if there is none.
    """

    systems: tuple[DelaySystem, ...]
    speeds: Real
    steps: Real
    first: Index

    def ranked(self, rank: int) -> tuple[float, float]:
        """Return an interval (m) of one part in a thousand that contains the limit of a rank; the lowest has rank 1.

        Both ends are infinite if it lies above the last step.
        """
        step = int(np.sort(self.first)[rank - 1])
        if step == len(self.steps):
            return np.inf, np.inf
        low, high = float(self.steps[step - 1]) if step else 0.0, float(self.steps[step])
        lower, tried = int((self.first < step).sum()), np.flatnonzero(self.first == step).tolist()
        while high - low > SETTINGS.ranked_tolerance * high:
            middle = (low + high) / 2
            unstable = [draw for draw in tried if self._unstable(draw, middle)]
            if lower + len(unstable) >= rank:
                high, tried = middle, unstable
            else:
                low, lower, tried = middle, lower + len(unstable), [draw for draw in tried if draw not in unstable]
        return low, high

    def _unstable(self, draw: int, depth: float) -> bool:
        return bool(unstable_at(self.systems[draw], self.speeds, np.full((len(self.speeds), 1), depth)).any())


def ranked_limits(draws: list[tuple[ModalModel, MillingProcess]], speeds: Real, steps: Real) -> RankedLimits:
    """Sort the limits of structures and cuts into steps of depth (m), each the lowest over the speeds (rad/s)."""
    systems = tuple(delay_system(structure, cut) for structure, cut in draws)
    first = np.array([_first_unstable(system, speeds, steps) for system in systems], dtype=np.int64)
    return RankedLimits(systems, speeds, steps, first)


def _first_unstable(system: DelaySystem, speeds: Real, steps: Real) -> int:
    """Return the number of the lowest step at which a cut is unstable at one of the speeds; their count if none is.

    The multipliers of straight edges are computed for all depths at once; others cost as much for each depth, and the
    steps are bisected.
    """
    if system.process.is_plain:
        unstable = unstable_at(system, speeds, np.tile(steps, (len(speeds), 1))).any(axis=0)
        return int(np.argmax(unstable)) if unstable.any() else len(steps)
    low, high = -1, len(steps)
    while high - low > 1:
        middle = (low + high) // 2
        if unstable_at(system, speeds, np.full((len(speeds), 1), steps[middle])).any():
            high = middle
        else:
            low = middle
    return high


def steps_around(limit: float, max_depth: float) -> Real:
    """Return rising depths (m) about a limit up to the largest depth, which are denser near the limit."""
    around = min(limit, max_depth) * np.array(SETTINGS.ranked_steps)
    return np.append(around[around < max_depth], max_depth)
