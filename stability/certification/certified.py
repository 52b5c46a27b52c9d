"""The depth limits that everything else stands on: a converged time-periodic solver, verified with multipliers."""

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from estimation import Frf
from modal_fit import ModalModel

from ..characteristic_roots import safe_depth
from ..lobes import StabilityLobes
from ..milling_loop import DelaySystem, delay_system
from ..solvers import checked_speeds, lowest_limits, multi_frequency, multi_frequency_limits, slowest_speed
from .second_look import CLIMB, SecondLook, second_look
from .verification import verify

Real = NDArray[np.float64]


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
    return _climbed(delay_system(structure, process), checked_speeds(spindle_speeds, max_depth), max_depth)


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


def _climbed(system: DelaySystem, speeds: Real, max_depth: float) -> StabilityLobes:
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
