"""Limits verified with Floquet multipliers: just below, just above, and on a ladder of depths beneath."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..floquet import unstable_cuts
from ..milling_loop import DelaySystem

Real = NDArray[np.float64]

JUST = 5e-4
"""Share of a limit by which the depths just below and just above differ from it."""

RUNG = 1.3
"""Ratio of two depths of the ladder."""


@dataclass(frozen=True)
class Verification:
    """Result of checking limits with Floquet multipliers.

    Parameters
    ----------
    agrees : (n_speeds,), bool
        No multiplier beyond the circle on the ladder and just below the limit, one beyond it just above.
    stable_to : (n_speeds,), m
        Highest rung below which all were stable.
    unstable_from : (n_speeds,), m
        Lowest depth found unstable; infinite where there was none.
    """

    agrees: NDArray[np.bool_]
    stable_to: Real
    unstable_from: Real


def ladder(first: float, top: float, ratio: float = RUNG) -> Real:
    """Depths from ``first`` up to ``top`` (m), each ``ratio`` times the one below it, and the top itself.

    Examples
    --------
    >>> ladder(1.0, 2.0, 1.5).tolist()
    [1.0, 1.5, 2.0]
    """
    if top <= first:
        return np.array([top])
    count = int(np.ceil(np.log(top / first) / np.log(ratio) - 1e-9))
    return np.append(first * ratio ** np.arange(count), top)


def verify(system: DelaySystem, speeds: Real, limits: Real, max_depth: float, first: float) -> Verification:
    """Check lowest limits with Floquet multipliers.

    Parameters
    ----------
    system
        Structure and process.
    speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    limits : (n_speeds,), m
        Lowest limits; infinite where there is said to be none.
    max_depth : m
        Depth up to which the ladder goes where there is no limit.
    first : m
        Lowest depth of the ladder.
    """
    limited = np.isfinite(limits)
    tops = np.where(limited, (1 - JUST) * np.where(limited, limits, 1.0), max_depth)
    above = [np.array([(1 + JUST) * limit]) if np.isfinite(limit) else np.zeros(0) for limit in limits]
    rungs = [np.append(ladder(first, float(top)), last) for top, last in zip(tops, above, strict=True)]
    owner = np.repeat(np.arange(len(speeds)), [len(rung) for rung in rungs])
    depths = np.concatenate(rungs)
    bad = unstable_cuts(system, speeds[owner], depths)
    unstable_from, stable_to = np.full(len(speeds), np.inf), np.zeros(len(speeds))
    np.minimum.at(unstable_from, owner[bad], depths[bad])
    below = depths < unstable_from[owner]
    np.maximum.at(stable_to, owner[below], depths[below])
    wanted = np.where(limited, (1 + JUST) * np.where(limited, limits, 1.0), np.inf)
    return Verification(unstable_from == wanted, stable_to, unstable_from)
