"""The cut with the largest removal rate at a stated confidence of stability."""

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from .certification import certified_numerics
from .drawn_structures import Draw, drawn, reached_by_islands
from .limit_interval import sampled_limits
from .lobes_result import StabilityLobes
from .ranked_limits import ranked_limits, steps_around
from .robust_depth import RobustCut
from .sensitivity import depth_errors, speeds_within, usable_limits
from .settings import SETTINGS
from .unmeasured import unmeasured_dynamics

CONFIDENCE = 0.975  # probability of stability of a recommended cut: it is at the lower end of the 95 % interval
DRIFT = 0.02  # relative drift of the spindle speed


@dataclass(frozen=True)
class RecommendedCut:
    """The cut with the largest removal rate at a stated confidence.

    Parameters
    ----------
    spindle_speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth of cut.
    confidence
        Probability that the cut is stable at every speed inside the drift.
    removal : m rad/s
        Depth times speed, to which the removal rate is proportional.
    drift
        Largest relative deviation of the speed that the cut allows for.
    draws
        Number of draws of structure and coefficients, according to their errors, that determined the depth; 0: first
        order only.
    unmeasured_share
        Share of the depth that remains after the effect of modes that no measurement shows is deducted; 1: none.
    """

    spindle_speed: float
    depth: float
    confidence: float
    removal: float
    drift: float = 0.0
    draws: int = 0
    unmeasured_share: float = 1.0


def recommended_cut(
    lobes: StabilityLobes, errors: Real, *, confidence: float = 0.95, drift: float = 0.02, max_depth: float = math.inf
) -> RecommendedCut:
    """Find the cut with the largest depth times speed that is stable with ``confidence`` at all speeds in the drift.

    At a given feed per tooth and radial engagement the removal rate is proportional to depth times speed. Limits are
    interpolated linearly between speeds; :func:`certified_cut` computes them instead. Where a limit or its error is not
    known no cut is recommended; where there is no limit, the depth is at most ``max_depth`` (m). ``errors`` are
    standard errors of the limits (m), ``drift`` is the largest relative deviation of the spindle speed.
    """
    allowed = _allowed(lobes, errors, confidence, drift, max_depth)
    removal = allowed * lobes.spindle_speeds
    best = int(np.argmax(removal))
    if allowed[best] <= 0:
        raise InputError(f"no cut is stable with confidence {confidence:g}")
    speed, depth = float(lobes.spindle_speeds[best]), float(allowed[best])
    return RecommendedCut(speed, depth, confidence, float(removal[best]), drift)


def certified_cut(
    structure: Frf | ModalModel,
    process: MillingProcess,
    lobes: StabilityLobes,
    errors: Real,
    *,
    confidence: float = 0.95,
    drift: float = 0.02,
    max_depth: float,
    seed: int = 0,
    given: Sequence[Draw] = (),
) -> RecommendedCut:
    """Recommend a cut as ``recommended_cut`` does, but compute limits inside the drift, and use draws.

    Speeds are considered in the order of their largest possible removal rate. For each speed, limits are computed at 17
    speeds inside its drift, so that no notch between two speeds of ``lobes`` is missed, and reduced by their errors and
    by what modes that no measurement shows can take away (:class:`RobustCut`).
    Then 39 or more structures and coefficients are drawn according to their errors. The depth is lowered until a share
    ``confidence`` of the draws is stable at every computed speed inside the drift (no draws for an FRF). The search
    ends when no further speed can have a larger removal rate. If errors are so large that the first order allows no
    depth, the limits without reduction give the largest possible rate, and draws decide.

    Parameters
    ----------
    structure, process
        Structure and cut that the lobes were computed from, with their errors.
    lobes, errors
        Limits from :func:`certified_lobes`, and their standard errors from :func:`depth_errors` ((n_speeds,), m).
    confidence, drift, max_depth
        Options of ``recommended_cut``; the depth is finite, and draws are solved up to it.
    seed
        Seed of the random generator.
    given
        Structures and cuts of equal weight instead of those drawn from the errors; then they alone decide, as their
        errors need not be normal, and ``errors`` are not used.

    Raises
    ------
    InputError
        As ``recommended_cut``.
    """
    unmeasured = unmeasured_dynamics(structure)
    robust = None if unmeasured is None or not process.is_helical else RobustCut(structure, process, unmeasured)
    search = _Search(structure, process, confidence, drift, max_depth, seed, robust, given=tuple(given))
    drawn = search.draws > 0
    if given:
        search, errors = replace(search, first_order=False), np.zeros_like(errors)
    best = search.best(_allowed(lobes, errors, confidence, drift, max_depth, drawn=drawn), lobes.spindle_speeds)
    if best is None and drawn:
        search = replace(search, first_order=False)
        best = search.best(_allowed(lobes, 0 * errors, confidence, drift, max_depth, drawn=drawn), lobes.spindle_speeds)
    if best is None:
        raise _no_cut(search, lobes)
    return RecommendedCut(best.speed, best.depth, confidence, best.removal, drift, search.draws, best.share)


def _no_cut(search: "_Search", lobes: StabilityLobes) -> InputError:
    """State why no cut is stable with the confidence, with what to measure."""
    text = f"no cut is stable with confidence {search.confidence:g}"
    spread, limits = np.zeros(len(lobes.depth_limits)), np.asarray(lobes.depth_limits)
    if not _lower(lobes, spread, search.confidence, search.max_depth).any():
        return InputError(f"{text}: no limit is known at any speed, see the warnings of the lobes")
    if search.robust is not None:
        shares = search.unmeasured_shares(np.minimum(np.nan_to_num(limits), search.max_depth), lobes.spindle_speeds)
        if not shares.any():
            unmeasured = search.robust.unmeasured
            low, high = unmeasured.band
            if unmeasured.cross_terms is not None:
                return InputError(
                    f"{text}: cross terms that were not measured may make the cut unstable at any depth and speed of "
                    "the lobes; hit each direction and measure the other, too"
                )
            return InputError(
                f"{text}: modes outside the {low:g} to {high:g} Hz in which the structure was measured may be unstable "
                "at any depth and speed of the lobes; measure a wider band (tap the tip)"
            )
    exact = replace(search.process, ktc_std=0.0, krc_std=0.0, kac_std=0.0)
    own = np.zeros(len(limits))
    if search.structure.covariance is not None:
        own = depth_errors(search.structure, exact, lobes)
    whole = depth_errors(search.structure, search.process, lobes)
    with np.errstate(invalid="ignore", divide="ignore"):
        parts = [np.nanmedian(part / limits) for part in (own, np.sqrt(np.maximum(whole**2 - own**2, 0.0)))]
    names = ("the structure (take more averages, or longer recordings)", "the cutting coefficients (fit more cuts)")
    larger = int(parts[1] > parts[0])
    return InputError(
        f"{text}: the errors of {names[larger]} are too large, {100 * parts[larger]:.2g} % of the limit in the median"
    )


@dataclass(frozen=True)
class _Candidate:
    """Cut during the search: the depth is an upper bound that each completed stage can only lower."""

    speed: float  # rad/s
    depth: float  # m
    stage: int = 0
    share: float = 1.0  # of the depth that unmeasured modes leave

    @property
    def removal(self) -> float:
        """Return depth times speed, m rad/s."""
        return self.depth * self.speed


@dataclass(frozen=True)
class _Search:
    """Search over speeds; with ``first_order`` limits are reduced by their errors before draws are computed."""

    structure: Frf | ModalModel
    process: MillingProcess
    confidence: float
    drift: float
    max_depth: float
    seed: int
    robust: RobustCut | None = None
    first_order: bool = True
    given: tuple[Draw, ...] = ()

    @property
    def draws(self) -> int:
        """Return the number n of draws: the k-th lowest limit of n draws has a confidence of ``1 - k / (n + 1)``."""
        if self.given:
            return len(self.given)
        return max(39, math.ceil(1 / (1 - self.confidence)) - 1) if isinstance(self.structure, ModalModel) else 0

    def best(self, allowed: Real, speeds: Real) -> _Candidate | None:
        """Find the candidate with the largest removal rate; return None if no depth is allowed."""
        allowed = allowed * self.unmeasured_shares(allowed, speeds)
        stages = (self.inside_drift, self.from_draws) if self.draws else (self.inside_drift,)
        # a heap by falling removal; the counter decides between equal ones
        candidates = [_Candidate(float(s), float(a)) for s, a in zip(speeds, allowed, strict=True)]
        heap = [(-candidate.removal, k, candidate) for k, candidate in enumerate(candidates)]
        heapq.heapify(heap)
        budget = [SETTINGS.most_computed, SETTINGS.most_sampled]
        best: _Candidate | None = None
        while heap:
            _, k, candidate = heapq.heappop(heap)
            if candidate.depth <= 0 or (best is not None and candidate.removal <= best.removal):
                break
            # speeds beyond the budget of a stage are left out, so that those already computed are completed
            if budget[candidate.stage] <= 0 and (candidate.stage == 0 or best is not None):
                continue
            budget[candidate.stage] -= 1
            lower = replace(stages[candidate.stage](candidate), stage=candidate.stage + 1)
            if lower.stage < len(stages):
                heapq.heappush(heap, (-lower.removal, k, lower))
            elif lower.depth > 0 and (best is None or lower.removal > best.removal):
                best = lower
        return best

    def unmeasured_shares(self, allowed: Real, speeds: Real) -> Real:
        """Estimate for all speeds, from some of them, the share of the depth that unmeasured modes leave."""
        if self.robust is None:
            return np.ones(len(speeds))
        known = np.flatnonzero(allowed > 0)
        if not len(known):
            return np.ones(len(speeds))
        chosen = known[np.unique(np.linspace(0, len(known) - 1, SETTINGS.robust_speeds).round().astype(int))]
        left = [self.robust.depth(float(speeds[k]), float(allowed[k])) / allowed[k] for k in chosen]
        return np.asarray(np.interp(speeds, speeds[chosen], left))

    def inside_drift(self, candidate: _Candidate) -> _Candidate:
        """Compute limits at speeds inside the drift, and deduct their errors and the effect of unmeasured modes."""
        fine = certified_numerics(self.structure, self.process, _around(candidate.speed, self.drift), self.max_depth)
        errors = np.zeros(len(fine.depth_limits))
        if not self.given:
            errors = depth_errors(self.structure, self.process, fine)
            errors = errors if self.first_order else 0 * errors
        lower = _lower(fine, errors, self.confidence, self.max_depth, drawn=self.draws > 0)
        lowest = float(lower.min())
        if self.robust is None or lowest <= 0:
            return replace(candidate, depth=min(candidate.depth, lowest))
        limits = np.minimum(fine.depth_limits, self.max_depth)
        chosen = np.unique([*np.linspace(0, len(lower) - 1, SETTINGS.sampled_speeds).astype(int), limits.argmin()])
        left = np.array([self.robust.depth(float(fine.spindle_speeds[k]), float(limits[k])) for k in chosen])
        depth = min(lowest, float((left * lower[chosen] / limits[chosen]).min()))
        return replace(candidate, depth=depth, share=float((left / limits[chosen]).min()))

    def from_draws(self, candidate: _Candidate) -> _Candidate:
        """Lower the depth until a share ``confidence`` of the draws is stable; unmeasured modes leave their share."""
        assert isinstance(self.structure, ModalModel)
        depth = min(candidate.depth / candidate.share, self.max_depth) if candidate.share > 0 else 0.0
        if depth <= 0:
            return replace(candidate, depth=0.0)
        fine = _around(candidate.speed, self.drift)
        lobes = certified_numerics(self.structure, self.process, fine, 2 * depth)
        order = np.argsort(np.nan_to_num(lobes.depth_limits, nan=0.0))
        chosen = np.unique([*order[: SETTINGS.sampled_speeds - 2], 0, len(fine) - 1])
        rank = max(1, math.floor((1 - self.confidence) * (self.draws + 1) + 1e-9))
        every = np.isin(np.arange(len(fine)), chosen)
        draws = list(self.given) or drawn(self.structure, self.process, self.draws, self.seed)
        if reached_by_islands(self.structure, self.process, lobes, 2 * depth, every, self.seed, self.given).any():
            samples = sampled_limits(draws, fine[chosen], depth)
            lowest = float(np.sort(np.minimum(samples, depth).min(axis=1))[rank - 1])
        else:
            lowest = min(depth, ranked_limits(draws, fine[chosen], steps_around(depth, depth)).ranked(rank)[0])
        return replace(candidate, depth=min(candidate.depth, candidate.share * lowest))


def lowered(cut: RecommendedCut, share: float) -> RecommendedCut:
    """Return the same cut at a share of its depth."""
    return replace(cut, depth=share * cut.depth, removal=share * cut.removal)


def _allowed(
    lobes: StabilityLobes, errors: Real, confidence: float, drift: float, max_depth: float, *, drawn: bool = False
) -> Real:
    """Compute the depth (m) allowed at each speed of the lobes over its drift, by linear interpolation; 0: no depth."""
    if not 0.5 <= confidence < 1 or not 0 <= drift < 0.5:
        raise InputError(f"confidence {confidence:g} must lie in 0.5 ... 1 and drift {drift:g} in 0 ... 0.5")
    lower = _lower(lobes, errors, confidence, max_depth, drawn=drawn)
    speeds = lobes.spindle_speeds
    ranges = [speeds_within(speeds, float(s), drift) for s in speeds]
    return np.asarray([float(np.interp(near, speeds, lower).min()) for near in ranges])


def _lower(lobes: StabilityLobes, errors: Real, confidence: float, max_depth: float, *, drawn: bool = False) -> Real:
    """Compute the depth (m) that is stable at each speed with the confidence; 0 if nothing is known.

    Where there is no limit, the first order gives no error. With ``drawn`` the draws alone decide there.
    """
    limits, spread = usable_limits(lobes, errors, max_depth)
    if drawn:
        spread = np.where(np.isposinf(lobes.depth_limits) & np.isfinite(spread), 0.0, spread)
    return np.asarray(np.maximum(np.nan_to_num(limits - scipy.special.ndtri(confidence) * spread, nan=0.0), 0.0))


def _around(speed: float, drift: float) -> Real:
    count = SETTINGS.fine_speeds
    return np.asarray(speed * (1 + (np.linspace(-drift, drift, count) if drift else np.zeros(1))))
