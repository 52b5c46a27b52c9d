"""A second search for a limit that the multipliers deny: a denser ladder, halving, a second discretisation."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..characteristic_roots import strongest_line
from ..floquet import kind_of, monodromies, period_operator, unstable_cuts
from ..milling_loop import DelaySystem
from ..solvers import critical_motion, semi_discretised
from .verification import JUST, ladder

Real = NDArray[np.float64]

DENSE = 1.05
"""Ratio of two depths of the denser ladder."""

CLIMB = 1.15
"""The same where the ladder alone looks for the limit: with a helix, unequal pitch or process damping."""


@dataclass(frozen=True)
class SecondLook:
    """Limit at one speed, found anew.

    Parameters
    ----------
    depth : m
        Limit; infinite where no cut of the ladder is unstable, NaN where nothing is known.
    frequency : Hz
        Chatter frequency; NaN where there is no limit.
    kind
        Bifurcation, as in ``StabilityLobes``.
    status
        Worth of the limit, as in ``StabilityLobes``.
    """

    depth: float
    frequency: float
    kind: str
    status: str


NOTHING = SecondLook(np.nan, np.nan, "none", "unresolved")


def second_look(
    system: DelaySystem, speed: float, claimed: float, max_depth: float, first: float, *, ratio: float = DENSE
) -> SecondLook:
    """Find the lowest limit of one speed from multipliers alone.

    A ladder of depths, closer about the depth that was claimed, is climbed until a cut is unstable; between
    the last two rungs the limit is halved. It counts as verified where more nodes and, for straight edges at equal
    pitch, semi-discretisation find the same. Otherwise the highest stable rung is a lower bound.

    Parameters
    ----------
    system
        Structure and process.
    speed : rad/s
        Spindle speed of the cut.
    claimed : m
        Limit that the multipliers did not confirm; infinite where it was said that there is none.
    max_depth : m
        Largest axial depth that is searched.
    first : m
        Lowest depth of the ladder.
    ratio
        Ratio of two neighbouring depths of the ladder.
    """
    rungs = ladder(first, max_depth, ratio)
    if np.isfinite(claimed):
        close = claimed * (1 + np.concatenate([-np.geomspace(1e-5, 2e-2, 8), np.geomspace(1e-5, 2e-2, 8)]))
        rungs = np.unique(np.concatenate([rungs, close[(close > first) & (close < max_depth)]]))
    try:
        low, high = _climbed(system, speed, rungs)
        if low == 0.0:
            return NOTHING
        bound = SecondLook(low, np.nan, "none", "lower-bound")
        if high == np.inf:
            spurious = np.isfinite(claimed)
            return bound if spurious else SecondLook(np.inf, np.nan, "none", "verified")
        while high - low > 1e-7 * high:
            middle = (low + high) / 2
            low, high = (low, middle) if _unstable(system, speed, middle) else (middle, high)
        if not _confirmed(system, speed, high):
            return bound
        return _described(system, speed, high)
    except (InputError, np.linalg.LinAlgError):
        return NOTHING


def _climbed(system: DelaySystem, speed: float, rungs: Real) -> tuple[float, float]:
    """The last stable rung (0 where there is none) and the first unstable one (infinite where there is none)."""
    low = 0.0
    for part in np.array_split(rungs, int(np.ceil(len(rungs) / 16))):
        bad = unstable_cuts(system, np.full(len(part), speed), part)
        if bad.any():
            place = int(np.argmax(bad))
            return (float(part[place - 1]) if place else low), float(part[place])
        low = float(part[-1])
    return low, np.inf


def _unstable(system: DelaySystem, speed: float, depth: float, *, extra: int = 0) -> bool:
    return bool(unstable_cuts(system, np.array([speed]), np.array([depth]), extra=extra)[0])


def _confirmed(system: DelaySystem, speed: float, limit: float) -> bool:
    """Whether other discretisations have the limit at the same depth."""
    below, above = (1 - JUST) * limit, (1 + JUST) * limit
    depths = [(below, False)] + ([(above, True)] if _unstable(system, speed, above) else [])
    for depth, wanted in depths:
        if _unstable(system, speed, depth, extra=6) != wanted:
            return False
        if system.process.is_plain and not system.upper.any():
            values = semi_discretised(system, speed, depth, steps=120, order=3).values
            if bool(np.abs(values).max() >= 1) != wanted:
                return False
    return True


def _described(system: DelaySystem, speed: float, limit: float) -> SecondLook:
    """Kind and frequency of a limit, from the multiplier on the circle."""
    if not system.process.is_plain:
        frequency, kind = critical_motion(system, speed, limit)
        return SecondLook(limit, frequency, kind, "verified")
    operator = period_operator(system, np.array([2 * np.pi / (system.process.teeth * speed)]))
    values = np.linalg.eigvals(monodromies(operator, np.zeros(1, dtype=np.int64), np.array([limit]))[0])
    value = complex(values[np.argmax(np.abs(values))])
    return SecondLook(limit, strongest_line(system, speed, limit, value), kind_of(value), "verified")
