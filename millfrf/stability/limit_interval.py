"""Confidence interval of a stability limit, and whether the structure's errors leave a limit certain."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Index, InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from .drawn_structures import Draw, drawn, reached_by_islands
from .floquet.multipliers import multipliers
from .lobes_result import StabilityLobes
from .milling_loop import delay_system
from .ranked_limits import ranked_limits, steps_around, unstable_at
from .sensitivity import depth_errors
from .settings import SETTINGS
from .solvers.collocation import lowest_limits
from .turning_limits import turning_limits


def sampled_limits(draws: Sequence[Draw], spindle_speeds: Real, max_depth: float) -> Real:
    """Compute the lowest limits of draws, (n_draws, n_speeds), m; infinite above ``max_depth``, 0: unresolved.

    The solver is that of :func:`certified_lobes`, without its ladder of depths: multipliers of each draw are computed
    only just below the lowest of its limits. If the draw is not stable there, its limits are 0.
    """
    limits = np.empty((len(draws), len(spindle_speeds)))
    for k, (structure, cut) in enumerate(draws):
        if cut.is_turning:  # verified by another count already
            by_speed, _ = turning_limits(structure, cut, spindle_speeds, max_depth)
            limits[k] = [0.0 if limit.status == "unresolved" else limit.depth for limit in by_speed]
            continue
        lobes = lowest_limits(structure, cut, spindle_speeds, max_depth).lowest()
        limits[k] = np.where([status == "unresolved" for status in lobes.status], 0.0, lobes.depth_limits)
        worst = int(np.argmin(limits[k]))
        below = 0.999 * min(float(limits[k, worst]), max_depth)
        if not multipliers(structure, cut, float(spindle_speeds[worst]), below).stable:
            limits[k, worst] = 0.0
    return limits


@dataclass(frozen=True)
class LimitBand:
    """95 % interval of the depth limit at each speed.

    Parameters
    ----------
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    low, high : (n_speeds,), m
        Ends of the interval. ``high`` is infinite where the limit may lie above the largest depth searched; both are
        NaN where nothing is known.
    basis
        Origin of the interval at each speed: ``first-order``, ``samples``, or ``none``.
    """

    spindle_speeds: Real
    low: Real
    high: Real
    basis: tuple[str, ...]


def limit_band(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes, max_depth: float, seed: int = 0
) -> LimitBand:
    """Compute the 95 % interval of each limit of ``certified_lobes``, from errors of the structure and coefficients.

    Where the first order may fail (two lobes meet nearby, no limit was found, the error is large), or an island of
    instability lies below the limit of a drawn structure, the interval is from the smallest to the largest limit of 39
    structures and cuts that are drawn for a modal model. For an FRF there are no draws, only the first order.

    Parameters
    ----------
    structure, process, lobes
        Structure, cut and certified limits, as for :func:`depth_errors`.
    max_depth : m
        Largest depth up to which draws are solved.
    seed
        Seed of the random generator.

    Raises
    ------
    InputError
        As :func:`depth_errors`.
    """
    errors = depth_errors(structure, process, lobes)
    half = scipy.special.ndtri(0.5 + SETTINGS.confidence / 2) * errors
    low, high = np.maximum(lobes.depth_limits - half, 0.0), lobes.depth_limits + half
    known = np.isfinite(low) & np.array([status != "unresolved" for status in lobes.status], dtype=bool)
    basis = np.where(known, "first-order", "none").astype(object)
    low, high = np.where(known, low, np.nan), np.where(known, high, np.nan)
    uncertain = _first_order_uncertain(lobes, errors)
    if isinstance(structure, ModalModel):
        islands = reached_by_islands(structure, process, lobes, max_depth, known | uncertain, seed)
        chosen = np.flatnonzero(islands)
        if len(chosen):
            samples = sampled_limits(
                drawn(structure, process, SETTINGS.draws, seed), lobes.spindle_speeds[chosen], max_depth
            )
            complete = (samples > 0).all(axis=0)
            chosen, samples = chosen[complete], samples[:, complete]
            low[chosen], high[chosen] = samples.min(axis=0), samples.max(axis=0)
        ranked = np.flatnonzero(uncertain & ~islands)
        low[ranked], high[ranked] = _extremes(structure, process, lobes, max_depth, ranked, seed)
        basis[np.append(chosen, ranked)] = "samples"
    return LimitBand(lobes.spindle_speeds, low, high, tuple(str(origin) for origin in basis))


def _extremes(
    model: ModalModel, process: MillingProcess, lobes: StabilityLobes, max_depth: float, chosen: Index, seed: int
) -> tuple[Real, Real]:
    """Find the smallest and the largest limit (m) of the draws at each of the chosen speeds."""
    low, high = np.empty(len(chosen)), np.empty(len(chosen))
    draws = drawn(model, process, SETTINGS.draws, seed) if len(chosen) else []
    for k, place in enumerate(chosen):
        limit = float(np.nan_to_num(lobes.depth_limits[place], nan=max_depth))
        limits = ranked_limits(draws, lobes.spindle_speeds[[place]], steps_around(limit, max_depth))
        low[k], high[k] = limits.ranked(1)[0], limits.ranked(len(draws))[1]
    return low, high


def _first_order_uncertain(lobes: StabilityLobes, errors: Real) -> NDArray[np.bool_]:
    """Mark speeds with an unknown or large error, and speeds near a change of the chatter's frequency or kind."""
    speeds, frequency = lobes.spindle_speeds, lobes.chatter_frequencies
    uncertain = ~(errors < SETTINGS.large_error * lobes.depth_limits)
    kinds = np.array(lobes.bifurcations)
    jumps = (kinds[1:] != kinds[:-1]) | ~(np.abs(np.diff(frequency)) < SETTINGS.frequency_jump * frequency[1:])
    margin = SETTINGS.around_jump
    for k in np.flatnonzero(jumps):
        near = (speeds > speeds[k] * (1 - margin)) & (speeds < speeds[k + 1] * (1 + margin))
        near[max(0, k - 1) : k + 3] = True
        uncertain |= near
    return np.asarray(uncertain)


def with_model(
    structure: Frf | ModalModel, process: MillingProcess, lobes: StabilityLobes, max_depth: float
) -> StabilityLobes:
    """State for each limit whether the structure's own errors leave it certain to 7 %.

    The 95 % interval of a certain limit, from the structure's covariance, lies within 7 % of it; the errors of the
    cutting coefficients are not contained. 39 structures are drawn: 7 % below the limit no more may be unstable than
    the first order lets expect, since it says nothing of a second lobe just above the limit. Where the first order may
    fail, or gives no interval, each must be stable 7 % below the limit, and above it, up to 7 %, unstable. Without a
    limit, each must be stable up to 7 % below ``max_depth``. No structure may have an island of instability below the
    limit. For an FRF there is only the first order.

    Parameters
    ----------
    structure, process
        Structure and cut of the limits; without a covariance the lobes are returned unchanged.
    lobes
        Limits of any solver with time-periodic coefficients.
    max_depth : m
        Largest depth that was searched.
    """
    if structure.covariance is None or lobes.method in ("zero-order", "nyquist"):
        return lobes
    exact = replace(process, ktc_std=0.0, krc_std=0.0, kac_std=0.0)
    errors = depth_errors(structure, exact, lobes) if process.is_helical else np.full(len(lobes.depth_limits), np.nan)
    half = scipy.special.ndtri(0.5 + SETTINGS.confidence / 2) * errors
    with np.errstate(invalid="ignore"):
        large = half > SETTINGS.certain * lobes.depth_limits
        certain = half <= SETTINGS.certain * lobes.depth_limits
    stated = np.isfinite(half)
    if isinstance(structure, ModalModel):
        stated = ~np.isnan(lobes.depth_limits)
        first_order = certain & ~_first_order_uncertain(lobes, errors)
        certain[stated & ~large & ~first_order] = True
        certain &= _certain_in_draws(structure, exact, lobes, max_depth, certain, np.where(first_order, errors, np.nan))
        certain &= ~reached_by_islands(structure, exact, lobes, max_depth, certain)
    model = np.where(stated, np.where(certain, "certain", "uncertain"), "not-stated").tolist()
    status = [
        "uncertain" if status == "verified" and word == "uncertain" else status
        for status, word in zip(lobes.status, model, strict=True)
    ]
    return replace(lobes, status=tuple(status), model=tuple(model))


def _certain_in_draws(
    model: ModalModel,
    process: MillingProcess,
    lobes: StabilityLobes,
    max_depth: float,
    open_limits: NDArray[np.bool_],
    errors: Real,
) -> NDArray[np.bool_]:
    """Check of the ``open_limits`` whether those of all draws lie within 7 % of them.

    Where a standard error is given, as many draws may be unstable 7 % below the limit as it makes likely.
    """
    share, speeds, limits = SETTINGS.certain, lobes.spindle_speeds, lobes.depth_limits
    limited = np.isfinite(lobes.chatter_frequencies)  # otherwise cuts above may be stable
    tops = np.where(np.isfinite(limits), limits, max_depth)
    # an island of instability may end above the limit, and one may begin beneath where there was no limit
    below, above = (1 - share) * np.array(SETTINGS.certain_depths), 1 + share * np.array([0.5, 1.0])
    with_error = np.isfinite(errors)
    spread = np.where(errors > 0, errors, 1.0)
    beyond = np.where(errors > 0, scipy.special.ndtr(-share * limits / spread), 0.0)
    most = np.where(with_error, scipy.stats.binom.ppf(SETTINGS.confidence, SETTINGS.draws, beyond), 0)
    certain, count = open_limits.copy(), np.zeros(len(speeds), dtype=np.int64)
    if not certain.any():
        return certain
    try:
        draws = drawn(model, process, SETTINGS.draws, 0)
    except InputError:  # the poles are so uncertain that they may not decay
        return ~open_limits
    for structure, _ in draws:
        system = delay_system(structure, process)
        free, bounded = np.flatnonzero(certain & ~limited), np.flatnonzero(certain & limited)
        certain[free] = ~unstable_at(system, speeds[free], np.outer(tops[free], below)).any(axis=1)
        unstable = unstable_at(system, speeds[bounded], np.outer(tops[bounded], [below[-1], *above]))
        count[bounded] += unstable[:, 0]
        certain[bounded] = (count[bounded] <= most[bounded]) & (unstable[:, 1:].any(axis=1) | with_error[bounded])
    return certain
