"""The cut that removes most at a stated confidence, from certified limits and their errors."""

import heapq
import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from .certification import certified_lobes
from .lobes_result import StabilityLobes
from .uncertainty.interval import sampled_limits
from .uncertainty.sensitivity import depth_errors, speeds_within, usable_limits

FINE = 17
"""Speeds inside the drift at which the limits are computed anew."""

SAMPLED_SPEEDS = 5
"""Of these, the ones with the lowest limits and both ends, at which draws are solved."""

LOOKED_AT = (8, 2)
"""Most speeds whose drift is computed, and most that are sampled."""


@dataclass(frozen=True)
class RecommendedCut:
    """The cut that removes most at a stated confidence.

    Parameters
    ----------
    spindle_speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth of cut.
    confidence
        Probability that the cut is stable wherever the speed drifts.
    removal : m rad/s
        Depth times speed, the part of the removal rate that was chosen.
    drift
        Largest relative deviation of the speed that it allows for.
    draws
        Number of structures and coefficients drawn from their errors at which the cut was tried; 0: first order alone.
    """

    spindle_speed: float
    depth: float
    confidence: float
    removal: float
    drift: float = 0.0
    draws: int = 0


def recommended_cut(
    lobes: StabilityLobes, errors: Real, *, confidence: float = 0.95, drift: float = 0.02, max_depth: float = math.inf
) -> RecommendedCut:
    """The cut with the largest depth times speed that is stable with ``confidence`` whatever the speed drifts.

    At a given feed per tooth and radial engagement the removal rate is proportional to depth times speed. This stands
    on the limits given and on straight lines between them; :func:`certified_cut` computes what lies between. Where a
    limit or its error is not known nothing is recommended; where there is no limit, no more than ``max_depth``.

    Parameters
    ----------
    lobes, errors
        Limits, and their standard errors ((n_speeds,), m).
    confidence
        Probability of stability that is asked for, between 0.5 and 1.
    drift
        Largest relative deviation of the spindle's speed.
    max_depth : m
        Largest axial depth that the cutter allows.

    Raises
    ------
    InputError
        A confidence or drift that cannot be, or no cut with that confidence.
    """
    allowed = _allowed(lobes, errors, confidence, drift, max_depth)
    removal = allowed * lobes.spindle_speeds
    best = int(np.argmax(removal))
    if allowed[best] <= 0:
        raise InputError(f"no cut is stable with confidence {confidence:g}; measure longer or lower the confidence")
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
    """Recommend a cut as :func:`recommended_cut` does, with limits inside the drift computed anew and tried with draws.

    Speeds are taken in the order of what they promise. The limits of one are computed at 17 speeds inside its drift, so
    that no notch between two speeds of ``lobes`` is passed over, and lessened by their errors. Then 39 or more
    structures and coefficients are drawn from their errors, and the depth is lowered to the one at which
    ``confidence`` of them are stable at every speed tried inside the drift (of an FRF there are no draws). What is left
    is compared with the next speed's promise. Where errors are as large as the limits their first order leaves nothing;
    then the limits alone are the promise, and draws decide.

    Parameters
    ----------
    structure, process
        Structure and cut that the lobes were computed from, with their errors.
    lobes, errors
        Limits from :func:`certified_lobes`, and their standard errors from :func:`depth_errors` ((n_speeds,), m).
    confidence, drift, max_depth
        Options of :func:`recommended_cut`; the depth is finite, and draws are solved up to it.
    seed
        Seed of the generator that draws.

    Raises
    ------
    InputError
        As :func:`recommended_cut`.
    """
    search = _Search(structure, process, confidence, drift, max_depth, seed)
    proven = search.best(_allowed(lobes, errors, confidence, drift, max_depth), lobes.spindle_speeds)
    if proven is None and search.draws:  # errors so large that their first order leaves nothing: draws tell more
        search = replace(search, first_order=False)
        proven = search.best(_allowed(lobes, 0 * errors, confidence, drift, max_depth), lobes.spindle_speeds)
    if proven is None:
        raise InputError(f"no cut is stable with confidence {confidence:g}; measure longer or lower the confidence")
    speed, depth = proven
    return RecommendedCut(speed, depth, confidence, depth * speed, drift, search.draws)


@dataclass(frozen=True)
class _Search:
    """Limits inside a drift and draws of them; with ``first_order`` errors are taken off before draws."""

    structure: Frf | ModalModel
    process: MillingProcess
    confidence: float
    drift: float
    max_depth: float
    seed: int
    first_order: bool = True

    @property
    def draws(self) -> int:
        return draws_for(self.confidence) if isinstance(self.structure, ModalModel) else 0

    def best(self, allowed: Real, speeds: Real) -> tuple[float, float] | None:
        """Speed and depth that remove most; None where no depth is left."""
        promise = [(-float(a * s), 0, float(s), float(a)) for a, s in zip(allowed, speeds, strict=True)]
        heapq.heapify(promise)
        computed, sampled, last = 0, 0, 2 if self.draws else 1
        proven: list[tuple[float, float, float]] = []
        while promise and computed < LOOKED_AT[0] and sampled < LOOKED_AT[1]:
            removal, stage, speed, depth = heapq.heappop(promise)
            if depth <= 0 or (proven and removal >= min(proven)[0]):
                break
            if stage == 0:
                depth = min(depth, self.inside_drift(speed))
                computed += 1
            else:
                depth = self.of_draws(speed, depth)
                sampled += 1
            if stage + 1 == last:
                proven.append((-depth * speed, speed, depth))
            else:
                heapq.heappush(promise, (-depth * speed, stage + 1, speed, depth))
        if not proven or min(proven)[2] <= 0:
            return None
        return min(proven)[1:]

    def inside_drift(self, speed: float) -> float:
        """The depth that the computed limits inside the drift allow."""
        fine = certified_lobes(self.structure, self.process, _around(speed, self.drift), self.max_depth)
        errors = depth_errors(self.structure, self.process, fine)
        return float(_lower(fine, errors if self.first_order else 0 * errors, self.confidence, self.max_depth).min())

    def of_draws(self, speed: float, depth: float) -> float:
        """The depth, no more than ``depth``, at which ``confidence`` of the draws are stable inside the drift."""
        assert isinstance(self.structure, ModalModel)
        fine = _around(speed, self.drift)
        limits = certified_lobes(self.structure, self.process, fine, 2 * depth).depth_limits
        order = np.argsort(np.nan_to_num(limits, nan=0.0))
        chosen = np.unique([*order[: SAMPLED_SPEEDS - 2], 0, len(fine) - 1])
        samples = sampled_limits(self.structure, self.process, fine[chosen], depth, self.draws, self.seed)
        lowest = np.minimum(samples, depth).min(axis=1)
        rank = max(1, math.floor((1 - self.confidence) * (self.draws + 1) + 1e-9))
        return float(np.sort(lowest)[rank - 1])


def lowered(cut: RecommendedCut, share: float) -> RecommendedCut:
    """The same cut at a share of its depth."""
    return replace(cut, depth=share * cut.depth, removal=share * cut.removal)


def draws_for(confidence: float) -> int:
    """How many draws tell a quantile: the k-th lowest of n holds with a probability of ``1 - k / (n + 1)``."""
    return max(39, math.ceil(1 / (1 - confidence)) - 1)


def _allowed(lobes: StabilityLobes, errors: Real, confidence: float, drift: float, max_depth: float) -> Real:
    """Depth at each of the lobes' speeds that holds over the drift, on straight lines between limits; 0: none."""
    if not 0.5 <= confidence < 1 or not 0 <= drift < 0.5:
        raise InputError(f"confidence {confidence:g} must lie in 0.5 ... 1 and drift {drift:g} in 0 ... 0.5")
    lower = _lower(lobes, errors, confidence, max_depth)
    speeds = lobes.spindle_speeds
    ranges = [speeds_within(speeds, float(s), drift) for s in speeds]
    return np.asarray([float(np.interp(near, speeds, lower).min()) for near in ranges])


def _lower(lobes: StabilityLobes, errors: Real, confidence: float, max_depth: float) -> Real:
    """Depth that holds at each speed with the confidence; 0 where nothing is known."""
    limits, spread = usable_limits(lobes, errors, max_depth)
    return np.asarray(np.maximum(np.nan_to_num(limits - scipy.special.ndtri(confidence) * spread, nan=0.0), 0.0))


def _around(speed: float, drift: float) -> Real:
    return np.asarray(speed * (1 + (np.linspace(-drift, drift, FINE) if drift else np.zeros(1))))
