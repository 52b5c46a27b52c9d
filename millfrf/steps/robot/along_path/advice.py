"""Depth and spindle speed for each segment of a path, from postures learned by measurement."""

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial

import numpy as np

from millfrf.core import InputError, Real
from millfrf.core.progress import progress
from millfrf.cutting import MillingProcess
from millfrf.robot_model import (
    CutPath,
    CutPlace,
    LearnedPostures,
    PathSegment,
    Redundancy,
    limit_margin,
    predict_posture,
)
from millfrf.stability import CONFIDENCE, DRIFT, lowest_limits, ranked_depths

from ...settings import LOBES
from ..learned import spread_draws
from .optimum import unturned_sequence


@dataclass(frozen=True)
class AdvisedCut:
    """Cut for which depth and speed are sought.

    Parameters
    ----------
    process
        Cutter, engagement and coefficients.
    speeds : (n_speeds,), rad/s
        Spindle speeds to choose from.
    max_depth : m
        Largest depth that is searched.
    speed_error
        Largest relative deviation of the spindle speed; a limit is the lowest inside it.
    """

    process: MillingProcess
    speeds: Real
    max_depth: float
    speed_error: float = DRIFT


@dataclass(frozen=True)
class PredictedLimits:
    """Depth limits of the draws at each speed.

    Parameters
    ----------
    low, middle, high : (n_speeds,), m
        Depth below which 97.5 % of the draws are stable, median, and depth that 2.5 % exceed; at most the largest
        depth searched.
    frequency : (n_speeds,), Hz
        Chatter frequency of the mean model at its limit; NaN where there is none.
    remaining_variance
        Share of the variance over postures that the measurements leave.
    far
        Whether the posture is far from every measured one.
    """

    low: Real
    middle: Real
    high: Real
    frequency: Real
    remaining_variance: float
    far: bool


@dataclass(frozen=True)
class SegmentAdvice:
    """A segment, and at each speed the limits at that of its places where the depth is smallest."""

    segment: PathSegment
    limits: PredictedLimits


@dataclass(frozen=True)
class PathAdvice:
    """Advice along a path.

    Parameters
    ----------
    cut
        Cut, and the speeds to choose from.
    segments
        Segments in the order of the path.
    """

    cut: AdvisedCut
    segments: tuple[SegmentAdvice, ...]

    def depth(self, segment: SegmentAdvice, speed: int) -> float:
        """Depth (m) that holds in a segment at the speed of a number; NaN: none, or far from every measured posture."""
        low = float(segment.limits.low[speed])
        return low if low > 0 and not segment.limits.far else np.nan

    def speed(self, segment: SegmentAdvice) -> int:
        """Number of the speed with the largest removal rate: depth times speed at equal feed per tooth and width."""
        return int(np.argmax(segment.limits.low * self.cut.speeds))

    def common_speed(self) -> int:
        """Number of the speed with the largest removal rate in the worst measured segment; of all if none is."""
        measured = [segment for segment in self.segments if not segment.limits.far] or self.segments
        return int(np.argmax(np.min([segment.limits.low for segment in measured], axis=0) * self.cut.speeds))


def advise_along(
    learned: LearnedPostures,
    path: CutPath,
    segments: Sequence[PathSegment],
    cut: AdvisedCut,
    start: Real,
    pool: Executor | None,
) -> PathAdvice:
    """Predict limits at beginning, middle and end of each segment, with the redundancy at zero.

    Parameters
    ----------
    learned
        Process over postures, and its robot.
    path, segments
        Path and its parts.
    cut
        Cut, and the speeds to choose from.
    start : (n_moving,), rad or m
        Posture near which the path begins.
    pool
        Processes that share the places; None: this process.

    Raises
    ------
    InputError
        A place that the robot does not reach within its joint limits.
    """
    places = [place for segment in segments for place in segment.places]
    postures = _reached(learned, path, places, start)
    keys = [np.round([*q, *place.axes.ravel()], 9).tobytes() for q, place in zip(postures, places, strict=True)]
    first = {key: number for number, key in reversed(list(enumerate(keys)))}
    tried = sorted(first.values())
    active = learned.robot.mechanism.active
    work = partial(_limits_at, learned, cut)
    known: dict[bytes, PredictedLimits] = {}
    with progress("advice along the path", len(tried)) as update:
        predicted = (map if pool is None else pool.map)(
            work, [postures[i][active] for i in tried], [places[i].axes for i in tried]
        )
        for number, (i, limits) in enumerate(zip(tried, predicted, strict=True), 1):
            known[keys[i]] = limits
            update(number)
    of_places = [known[key] for key in keys]
    return PathAdvice(
        cut, tuple(SegmentAdvice(part, _worst(of_places[3 * k : 3 * k + 3])) for k, part in enumerate(segments))
    )


def _reached(learned: LearnedPostures, path: CutPath, places: Sequence[CutPlace], start: Real) -> list[Real]:
    """Return the posture at each place, (n_moving,); refuse a place that is not reached within the joint limits."""
    along = CutPath(tuple(places), None, np.zeros(len(places), dtype=bool))
    upright = Redundancy(np.zeros(1), np.zeros(1))
    postures = [q for q, _, _ in unturned_sequence(learned.robot, along, upright, start)]
    for q, place in zip(postures, places, strict=True):
        if not (np.isfinite(q).all() and limit_margin(learned.robot.mechanism, q) >= 0):
            x, y, z = place.position
            point = 1 + int(np.argmin(np.linalg.norm(path.positions - place.position, axis=1)))
            raise InputError(
                f"the robot does not reach x {x:.4g}, y {y:.4g}, z {z:.4g} m, near point {point} of the path, within "
                "its joint limits: move the path, turn the tool about its axis (rx_rad ry_rad rz_rad), or begin in "
                "another posture (--joints)"
            )
    return postures


def _limits_at(learned: LearnedPostures, cut: AdvisedCut, driven: Real, axes: Real) -> PredictedLimits:
    """Compute the limits in one posture (driven joint values), with the axes of the cut as columns."""
    predicted = predict_posture(learned, driven, axes=axes)
    draws = spread_draws(predicted.draws)
    mean = lowest_limits(predicted.model, cut.process, cut.speeds, cut.max_depth).lowest()
    rank = max(int((1 - CONFIDENCE) * (len(draws) + 1) + 1e-9), 1)
    ranks = (rank, (len(draws) + 1) // 2, len(draws) + 1 - rank)
    inside = np.linspace(-1.0, 1.0, LOBES.speeds_in_error) if cut.speed_error else np.zeros(1)
    low, middle, high = np.transpose(
        [
            ranked_depths(
                draws,
                cut.process,
                speed * (1 + cut.speed_error * inside),
                float(np.nan_to_num(limit, nan=cut.max_depth)),
                cut.max_depth,
                ranks,
            )
            for speed, limit in zip(cut.speeds, mean.depth_limits, strict=True)
        ]
    )
    return PredictedLimits(low, middle, high, mean.chatter_frequencies, predicted.remaining_variance, predicted.far)


def _worst(places: Sequence[PredictedLimits]) -> PredictedLimits:
    """Return at each speed the limits at the place with the smallest depth; far if one of the places is."""
    worst = np.argmin([place.low for place in places], axis=0)
    low, middle, high, frequency = (
        np.array([getattr(place, name) for place in places])[worst, np.arange(len(worst))]
        for name in ("low", "middle", "high", "frequency")
    )
    left = max(place.remaining_variance for place in places)
    return PredictedLimits(low, middle, high, frequency, left, any(place.far for place in places))
