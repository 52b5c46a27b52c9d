"""Certified depth limits: a converged time-periodic solution, verified with Floquet multipliers."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess, refuse_varied
from modal_fit import ModalModel

from .climbed_limits import UNRESOLVED, SpeedLimit, climbed_limits, ladder
from .floquet.collocated_period import period_operator
from .floquet.critical_lines import strongest_line
from .floquet.crossings import safe_depth
from .floquet.multipliers import kind_of, monodromies, unstable_cuts
from .limit_interval import with_model
from .lobes_result import StabilityLobes
from .milling_loop import DelaySystem, delay_system
from .robust_depth import with_band
from .settings import SETTINGS
from .solvers.collocation import lowest_limits
from .solvers.multi_frequency import BY_ERROR, multi_frequency, multi_frequency_limits, slowest_speed
from .solvers.semi_discretisation import semi_discretised
from .solvers.zero_order import checked_speeds
from .turning_limits import turning_limits


def certified_lobes(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Compute the lowest limit at each speed with time-periodic coefficients, and a status with its reliability.

    For a modal model, collocation gives the limits. Floquet multipliers verify each limit: 0.05 % below it, 0.05 %
    above it, and on a ladder of smaller depths; without a limit, on a ladder up to ``max_depth``. If they disagree, the
    limit is searched again with multipliers alone. A limit that cannot be verified is a lower bound or unresolved,
    never infinite. Of cutters that are not plain, the multipliers find the limit (``climbed_limits``), and of
    turning the number of unstable roots (``turning_limits``). For an FRF, the multi-frequency solution gives limits
    with a stated error, ``not-verified``.

    ``band`` states whether the limit rests on measured dynamics (:func:`with_band`), ``model`` whether the errors of
    the structure leave it certain (:func:`with_model`). Otherwise it is ``unmeasured`` or ``uncertain``, not
    ``verified``.

    Parameters
    ----------
    structure
        Modal model, or FRF, at the tool tip; receptance.
    process
        Cutter and engagement.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    max_depth : m
        Largest axial depth that is searched.

    Raises
    ------
    InputError
        As :func:`collocation` and :func:`multi_frequency`.
    """
    lobes = certified_numerics(structure, process, spindle_speeds, max_depth)
    return with_model(structure, process, with_band(structure, process, lobes, max_depth), max_depth)


def certified_numerics(
    structure: Frf | ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float
) -> StabilityLobes:
    """Compute :func:`certified_lobes` of the given structure, whatever its band and errors."""
    if isinstance(structure, Frf):
        return _from_frf(structure, process, checked_speeds(spindle_speeds, max_depth), max_depth)
    if process.is_turning:
        speeds = checked_speeds(spindle_speeds, max_depth)
        return _lobes(speeds, *turning_limits(structure, process, speeds, max_depth), "turning")
    if process.is_plain:
        lobes = lowest_limits(structure, process, spindle_speeds, max_depth).lowest()
        return _verified(delay_system(structure, process), lobes, max_depth)
    system, speeds = delay_system(structure, process), checked_speeds(spindle_speeds, max_depth)
    return _lobes(speeds, climbed_limits(system, speeds, max_depth), system.warnings, "collocation")


def _from_frf(frf: Frf, process: MillingProcess, speeds: Real, max_depth: float) -> StabilityLobes:
    """Compute the limits by the multi-frequency solution; speeds that are too slow for it are unresolved."""
    refuse_varied(
        process, "a limit from an FRF alone", "fit it, and give the model", takes=("turning", "pitch", "damping")
    )
    slowest = slowest_speed(frf, process)
    reached = speeds >= slowest
    if not reached.any():
        return multi_frequency(frf, process, speeds, max_depth)  # raises an error with the remedy
    limits = multi_frequency_limits(frf, process, speeds[reached], max_depth, lowest=True)
    lobes, kinds = limits.lowest(), np.full(len(speeds), "none", dtype=object)
    depths, frequencies = np.full(len(speeds), np.nan), np.full(len(speeds), np.nan)
    depths[reached], frequencies[reached] = lobes.depth_limits, lobes.chatter_frequencies
    kinds[reached] = lobes.bifurcations
    first = np.unique(limits.speed, return_index=True)[1]
    share = limits.error[first] / limits.depth[first] if len(first) else np.zeros(1)
    reasons = [text.partition(BY_ERROR)[2] for text in lobes.warnings if BY_ERROR in text]
    others = [text for text in lobes.warnings if BY_ERROR not in text]
    warning = (
        f"from an FRF alone, limits are not verified; their stated error is up to {share.max():.1%} (median "
        f"{np.median(share):.1%}){''.join(f', since {reason}' for reason in reasons)}: fit a model to verify"
    )
    if not reached.all():
        warning += f"; below {slowest * 30 / np.pi:.4g} rpm they would need too many harmonics"
    status = tuple(np.where(reached, "not-verified", "unresolved").tolist())
    return StabilityLobes(speeds, depths, frequencies, tuple(kinds.tolist()), lobes.method, (*others, warning), status)


def _verified(system: DelaySystem, lobes: StabilityLobes, max_depth: float) -> StabilityLobes:
    """Check the limits of collocation with multipliers; search a limit again where the multipliers disagree."""
    speeds = lobes.spindle_speeds
    first = min(safe_depth(system), max_depth)
    bounded = np.array([status == "lower-bound" for status in lobes.status])
    good = verify(system, speeds, lobes.depth_limits, max_depth, first) & ~bounded
    columns = (lobes.depth_limits, lobes.chatter_frequencies, lobes.bifurcations)
    limits = [
        SpeedLimit(float(depth), float(frequency), kind, "verified")
        for depth, frequency, kind in zip(*columns, strict=True)
    ]
    for k in np.flatnonzero(~good):
        claimed = np.inf if bounded[k] else limits[k].depth
        limits[k] = _searched(system, float(speeds[k]), claimed, max_depth, first, SETTINGS.dense_ratio)
    return _lobes(speeds, limits, system.warnings, "collocation")


def _lobes(speeds: Real, limits: list[SpeedLimit], warnings: tuple[str, ...], method: str) -> StabilityLobes:
    status = tuple(limit.status for limit in limits)
    bounds, unresolved = status.count("lower-bound"), status.count("unresolved")
    if bounds + unresolved:
        warnings += (
            f"of {len(status)} speeds {bounds} have a lower bound only and {unresolved} no limit that could be "
            "verified: plan no cut there",
        )
    return StabilityLobes(
        speeds,
        np.array([limit.depth for limit in limits]),
        np.array([limit.frequency for limit in limits]),
        tuple(limit.kind for limit in limits),
        method,
        warnings,
        status,
    )


def verify(system: DelaySystem, speeds: Real, limits: Real, max_depth: float, first: float) -> NDArray[np.bool_]:
    """Check at each speed whether Floquet multipliers agree with the lowest limit, m; infinite: no limit.

    They agree if the cut is stable on a ladder of depths from ``first`` (m) to just below the limit, and unstable just
    above the limit. Without a limit, the cut must be stable on a ladder up to ``max_depth``.
    """
    limited, margin = np.isfinite(limits), SETTINGS.beside_limit
    tops = np.where(limited, (1 - margin) * np.where(limited, limits, 1.0), max_depth)
    above = [np.array([(1 + margin) * limit]) if np.isfinite(limit) else np.zeros(0) for limit in limits]
    rungs = [
        np.append(ladder(first, float(top), SETTINGS.ladder_ratio), last) for top, last in zip(tops, above, strict=True)
    ]
    owner = np.repeat(np.arange(len(speeds)), [len(rung) for rung in rungs])
    depths = np.concatenate(rungs)
    unstable = unstable_cuts(system, speeds[owner], depths)
    unstable_from = np.full(len(speeds), np.inf)
    np.minimum.at(unstable_from, owner[unstable], depths[unstable])
    expected = np.where(limited, (1 + margin) * np.where(limited, limits, 1.0), np.inf)
    return np.asarray(unstable_from == expected)


def _searched(
    system: DelaySystem, speed: float, claimed: float, max_depth: float, first: float, ratio: float
) -> SpeedLimit:
    """Find the lowest limit of one speed (rad/s) from multipliers alone.

    Depths increase by ``ratio`` from ``first`` (m) until a cut is unstable; bisection follows. Steps are finer around
    the limit ``claimed`` (m) that the multipliers did not confirm (infinite: no limit was claimed). The limit is
    verified if more nodes and, for straight edges at equal pitch, semi-discretisation find the same limit. Otherwise
    the highest stable depth is a lower bound.
    """
    rungs = ladder(first, max_depth, ratio)
    if np.isfinite(claimed):
        close = claimed * (1 + np.concatenate([-np.geomspace(1e-5, 2e-2, 8), np.geomspace(1e-5, 2e-2, 8)]))
        rungs = np.unique(np.concatenate([rungs, close[(close > first) & (close < max_depth)]]))
    try:
        low, high = _bracket(system, speed, rungs)
        if low == 0.0:
            return UNRESOLVED
        bound = SpeedLimit(low, np.nan, "none", "lower-bound")
        if high == np.inf:
            # a limit was claimed but no cut is unstable: the two methods contradict each other
            contradicted = np.isfinite(claimed)
            return bound if contradicted else SpeedLimit(np.inf, np.nan, "none", "verified")
        while high - low > 1e-7 * high:
            middle = (low + high) / 2
            low, high = (low, middle) if _unstable(system, speed, middle) else (middle, high)
        if not _confirmed(system, speed, high):
            return bound
        return _described(system, speed, high)
    except (InputError, np.linalg.LinAlgError):
        return UNRESOLVED


def _bracket(system: DelaySystem, speed: float, rungs: Real) -> tuple[float, float]:
    """Return the last stable depth of ``rungs`` (0: none) and the first unstable depth (infinite: none)."""
    low = 0.0
    for batch in np.array_split(rungs, int(np.ceil(len(rungs) / 16))):  # no more depths than needed are computed
        unstable = unstable_cuts(system, np.full(len(batch), speed), batch)
        if unstable.any():
            index = int(np.argmax(unstable))
            return (float(batch[index - 1]) if index else low), float(batch[index])
        low = float(batch[-1])
    return low, np.inf


def _unstable(system: DelaySystem, speed: float, depth: float, *, extra: int = 0) -> bool:
    return bool(unstable_cuts(system, np.array([speed]), np.array([depth]), extra=extra)[0])


def _confirmed(system: DelaySystem, speed: float, limit: float) -> bool:
    """Check whether other discretisations find the limit at the same depth."""
    below, above = (1 - SETTINGS.beside_limit) * limit, (1 + SETTINGS.beside_limit) * limit
    # above the limit of a thin island the cut may be stable again
    depths = [(below, False)] + ([(above, True)] if _unstable(system, speed, above) else [])
    for depth, expected in depths:
        if _unstable(system, speed, depth, extra=6) != expected:
            return False
        if not system.upper.any():
            values = semi_discretised(system, speed, depth, steps=120, order=3).values
            if bool(np.abs(values).max() >= 1) != expected:
                return False
    return True


def _described(system: DelaySystem, speed: float, limit: float) -> SpeedLimit:
    """Add kind and frequency to a limit, from the multiplier on the unit circle."""
    operator = period_operator(system, np.array([2 * np.pi / (system.process.teeth * speed)]))
    values = np.linalg.eigvals(monodromies(operator, np.zeros(1, dtype=np.int64), np.array([limit]))[0])
    value = complex(values[np.argmax(np.abs(values))])
    return SpeedLimit(limit, strongest_line(system, speed, limit, value), kind_of(value), "verified")
