"""Confidence interval of a stability limit, and the cut with the largest removal rate at a stated confidence."""

import heapq
import math
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel, pack_parameters, unpack_parameters

from .certification import certified_numerics
from .floquet.multipliers import multipliers
from .lobes_result import StabilityLobes
from .robust_depth import RobustCut
from .sensitivity import depth_errors, speeds_within, usable_limits
from .settings import SETTINGS
from .solvers.collocation import lowest_limits
from .unmeasured import unmeasured_dynamics


def drawn(model: ModalModel, process: MillingProcess, count: int, seed: int) -> list[tuple[ModalModel, MillingProcess]]:
    """Draw structures and cuts from the model's covariance and the coefficients' errors, normally distributed.

    A model without covariance and coefficients without errors do not vary. A draw is repeated if one of its modes does
    not decay. K_tc stays above a twentieth of its value.
    """
    generator = np.random.default_rng(seed)
    centre = pack_parameters(model)
    root = np.zeros((len(centre), 0))
    if model.covariance is not None:
        # parameters differ in unit and size: the root is taken of the correlation
        scale = np.sqrt(np.maximum(np.diag(model.covariance), 1e-300))
        values, vectors = np.linalg.eigh(model.covariance / np.outer(scale, scale))
        root = scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
    draws = []
    for _ in range(count):
        for _ in range(20):
            structure = unpack_parameters(model, centre + root @ generator.standard_normal(root.shape[1]))
            if structure.poles.real.max() < 0:
                break
        else:
            raise InputError("the model's poles are so uncertain that draws of them do not decay; measure longer")
        ktc, krc, kac = np.array(process.coefficient_errors) * generator.standard_normal(3)
        cut = replace(
            process,
            ktc=max(process.ktc + float(ktc), 0.05 * process.ktc),
            krc=process.krc + float(krc),
            kac=process.kac + float(kac),
            ktc_std=0.0,
        )
        draws.append((replace(structure, covariance=None), cut))
    return draws


def sampled_limits(
    model: ModalModel, process: MillingProcess, spindle_speeds: Real, max_depth: float, count: int, seed: int = 0
) -> Real:
    """Compute the lowest limits of ``count`` draws, (count, n_speeds), m; infinite above ``max_depth``, 0: unresolved.

    The solver is that of :func:`certified_lobes`, without its ladder of depths: multipliers of each draw are computed
    only just below the lowest of its limits. If the draw is not stable there, its limits are 0.
    """
    limits = np.empty((count, len(spindle_speeds)))
    for k, (structure, cut) in enumerate(drawn(model, process, count, seed)):
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

    Where the first order may fail (two lobes meet nearby, no limit was found, the error is large), limits of 39 draws
    of a modal model are computed. If they contradict the first order at a speed, the interval is from their smallest
    to their largest limit. For an FRF there are no draws, only the first order.

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
        As :func:`depth_errors`; a helix, unequal pitch or process damping is refused.
    """
    errors = depth_errors(structure, process, lobes)
    half = scipy.special.ndtri(0.5 + SETTINGS.confidence / 2) * errors
    low, high = np.maximum(lobes.depth_limits - half, 0.0), lobes.depth_limits + half
    known = np.isfinite(low) & np.array([status != "unresolved" for status in lobes.status], dtype=bool)
    basis = np.where(known, "first-order", "none").astype(object)
    low, high = np.where(known, low, np.nan), np.where(known, high, np.nan)
    uncertain = np.flatnonzero(_first_order_uncertain(lobes, errors))
    if isinstance(structure, ModalModel) and len(uncertain):
        speeds = lobes.spindle_speeds[uncertain]
        samples = sampled_limits(structure, process, speeds, max_depth, SETTINGS.draws, seed)
        agree = _agree(samples, lobes.depth_limits[uncertain], errors[uncertain], half[uncertain])
        replaced = (samples > 0).all(axis=0) & ~(known[uncertain] & agree)
        chosen = uncertain[replaced]
        low[chosen], high[chosen] = samples[:, replaced].min(axis=0), samples[:, replaced].max(axis=0)
        basis[chosen] = "samples"
    return LimitBand(lobes.spindle_speeds, low, high, tuple(str(origin) for origin in basis))


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


def _agree(samples: Real, limits: Real, errors: Real, half: Real) -> NDArray[np.bool_]:
    """Check at each speed whether the draws spread as the first order predicts, (n_speeds,)."""
    finite = np.isfinite(samples).all(axis=0)
    deviation = np.where(finite, samples, 0.0) - limits
    outside = np.sum(~(np.abs(deviation) <= half), axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.sqrt(np.mean(deviation**2, axis=0)) / errors
    low, high = SETTINGS.spread
    return np.asarray(finite & (outside <= SETTINGS.most_outside) & (ratio > low) & (ratio < high))


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
        raise _no_cut(confidence)
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

    Raises
    ------
    InputError
        As ``recommended_cut``.
    """
    unmeasured = unmeasured_dynamics(structure)
    robust = None if unmeasured is None or not process.is_plain else RobustCut(structure, process, unmeasured)
    search = _Search(structure, process, confidence, drift, max_depth, seed, robust)
    drawn = search.draws > 0
    best = search.best(_allowed(lobes, errors, confidence, drift, max_depth, drawn=drawn), lobes.spindle_speeds)
    if best is None and drawn:
        search = replace(search, first_order=False)
        best = search.best(_allowed(lobes, 0 * errors, confidence, drift, max_depth, drawn=drawn), lobes.spindle_speeds)
    if best is None:
        raise _no_cut(confidence)
    return RecommendedCut(best.speed, best.depth, confidence, best.removal, drift, search.draws, best.share)


def _no_cut(confidence: float) -> InputError:
    return InputError(f"no cut is stable with confidence {confidence:g}; measure longer or lower the confidence")


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

    @property
    def draws(self) -> int:
        """Return the number n of draws: the k-th lowest limit of n draws has a confidence of ``1 - k / (n + 1)``."""
        return max(39, math.ceil(1 / (1 - self.confidence)) - 1) if isinstance(self.structure, ModalModel) else 0

    def best(self, allowed: Real, speeds: Real) -> _Candidate | None:
        """Find the candidate with the largest removal rate; return None if no depth is allowed."""
        allowed = allowed * self._unmeasured_shares(allowed, speeds)
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

    def _unmeasured_shares(self, allowed: Real, speeds: Real) -> Real:
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
        limits = certified_numerics(self.structure, self.process, fine, 2 * depth).depth_limits
        order = np.argsort(np.nan_to_num(limits, nan=0.0))
        chosen = np.unique([*order[: SETTINGS.sampled_speeds - 2], 0, len(fine) - 1])
        samples = sampled_limits(self.structure, self.process, fine[chosen], depth, self.draws, self.seed)
        lowest = np.minimum(samples, depth).min(axis=1)
        rank = max(1, math.floor((1 - self.confidence) * (self.draws + 1) + 1e-9))
        return replace(candidate, depth=min(candidate.depth, candidate.share * float(np.sort(lowest)[rank - 1])))


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
