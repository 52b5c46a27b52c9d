"""Certified depth limits: a converged time-periodic solution, verified with Floquet multipliers."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from .floquet.collocated_period import period_operator
from .floquet.multipliers import kind_of, monodromies, unstable_cuts
from .lobes_result import StabilityLobes
from .milling_loop import DelaySystem, delay_system
from .roots.critical_lines import strongest_line
from .roots.crossings import safe_depth
from .solvers.collocation import critical_motion, lowest_limits
from .solvers.multi_frequency import multi_frequency, multi_frequency_limits, slowest_speed
from .solvers.semi_discretisation import semi_discretised
from .solvers.zero_order import checked_speeds

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
        low, high = _climbed_of_second_look(system, speed, rungs)
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


def _climbed_of_second_look(system: DelaySystem, speed: float, rungs: Real) -> tuple[float, float]:
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


def certified_lobes(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Give the lowest limit at each speed with time-periodic coefficients, and a status that says how sure it is.

    For a modal model, collocation gives the limits. Floquet multipliers verify each limit just below it (0.05 %), just
    above it, and on a ladder of depths beneath it; where there is no limit, up to ``max_depth``. Where they disagree
    the limit is looked for again (``second_look``). A limit that cannot be settled is a lower bound or unresolved,
    never infinite. With a helix, unequal pitch or process damping the multipliers find the limit, on a ladder in steps
    of 15 %. For an FRF, the multi-frequency solution gives limits with a stated error, ``not-verified``.

    Parameters
    ----------
    structure
        Modal model, or FRF, at the tool tip; receptance.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds at which limits are wanted.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        As :func:`collocation` and :func:`multi_frequency`.
    """
    if isinstance(structure, Frf):
        return _of_frf(structure, process, checked_speeds(spindle_speeds, max_depth), max_depth)
    if process.is_plain:
        lobes = lowest_limits(structure, process, spindle_speeds, max_depth).lowest()
        return _verified(delay_system(structure, process), lobes, max_depth)
    return _climbed_of_certified(delay_system(structure, process), checked_speeds(spindle_speeds, max_depth), max_depth)


def _of_frf(frf: Frf, process: MillingProcess, speeds: Real, max_depth: float) -> StabilityLobes:
    """The multi-frequency solution, unresolved where the spindle is too slow for it."""
    reached = speeds >= slowest_speed(frf, process)
    if not reached.any():
        return multi_frequency(frf, process, speeds, max_depth)
    limits = multi_frequency_limits(frf, process, speeds[reached], max_depth, lowest=True)
    known, kinds = limits.lowest(), np.full(len(speeds), "none", dtype=object)
    depths, frequencies = np.full(len(speeds), np.nan), np.full(len(speeds), np.nan)
    depths[reached], frequencies[reached], kinds[reached] = (
        known.depth_limits,
        known.chatter_frequencies,
        known.bifurcations,
    )
    first = np.unique(limits.speed, return_index=True)[1]
    share = limits.error[first] / limits.depth[first] if len(first) else np.zeros(1)
    told = (
        f"from an FRF alone, limits are not verified; their stated error is up to {share.max():.1%} (median "
        f"{np.median(share):.1%}): fit a model to verify"
    )
    if not reached.all():
        told += f"; below {slowest_speed(frf, process) * 30 / np.pi:.4g} rpm they would need too many harmonics"
    status = tuple(np.where(reached, "not-verified", "unresolved").tolist())
    return StabilityLobes(
        speeds, depths, frequencies, tuple(kinds.tolist()), known.method, (*known.warnings, told), status
    )


def _verified(system: DelaySystem, lobes: StabilityLobes, max_depth: float) -> StabilityLobes:
    """Collocation's limits, each judged by multipliers and looked for again where these disagree."""
    first = min(safe_depth(system), max_depth)
    bounded = np.array([status == "lower-bound" for status in lobes.status])
    good = verify(system, lobes.spindle_speeds, lobes.depth_limits, max_depth, first).agrees & ~bounded
    limits = [
        SecondLook(float(depth), float(frequency), kind, "verified")
        for depth, frequency, kind in zip(
            lobes.depth_limits, lobes.chatter_frequencies, lobes.bifurcations, strict=True
        )
    ]
    for k in np.flatnonzero(~good):
        claimed = np.inf if bounded[k] else limits[k].depth
        limits[k] = second_look(system, float(lobes.spindle_speeds[k]), claimed, max_depth, first)
    return _together(lobes.spindle_speeds, limits, system.warnings)


def _climbed_of_certified(system: DelaySystem, speeds: Real, max_depth: float) -> StabilityLobes:
    """Limits of a cut with a helix, unequal pitch or process damping: multipliers find and verify them."""
    first = min(safe_depth(system), max_depth)
    limits = [second_look(system, float(speed), np.inf, max_depth, first, ratio=CLIMB) for speed in speeds]
    warning = f"depths were climbed in steps of {CLIMB - 1:.0%}; a thinner island of instability may be missed"
    return _together(speeds, limits, (*system.warnings, warning))


def _together(speeds: Real, limits: list[SecondLook], warnings: tuple[str, ...]) -> StabilityLobes:
    return StabilityLobes(
        speeds,
        np.array([limit.depth for limit in limits]),
        np.array([limit.frequency for limit in limits]),
        tuple(limit.kind for limit in limits),
        "collocation",
        warnings + _doubts([limit.status for limit in limits]),
        tuple(limit.status for limit in limits),
    )


def _doubts(status: list[str]) -> tuple[str, ...]:
    """A sentence on the limits that could not be verified."""
    bounds, open_ = status.count("lower-bound"), status.count("unresolved")
    if not bounds + open_:
        return ()
    return (
        f"of {len(status)} speeds {bounds} have a lower bound only and {open_} no limit that could be verified: "
        "plan no cut there",
    )
