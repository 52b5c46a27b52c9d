"""Depth limits before and after learning with their bands, and the cut that they advise."""

import math
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real

from ..certification import certified_lobes
from ..drawn_structures import Draw
from ..limit_interval import LimitBand, sampled_limits
from ..lobes_result import StabilityLobes
from ..recommendation import RecommendedCut, certified_cut
from ..settings import SETTINGS
from .learned import Learned


@dataclass(frozen=True)
class LearnedLimits:
    """Limits of the structure before and after learning.

    Parameters
    ----------
    before, after
        Limits of the mean structure and cut.
    band_before, band_after
        95 % intervals: the smallest and largest limit of 39 draws, with the correlations of structure and coefficients.
    max_depth : m
        Largest depth that was searched.
    """

    before: StabilityLobes
    after: StabilityLobes
    band_before: LimitBand
    band_after: LimitBand
    max_depth: float


def learned_limits(learned: Learned, spindle_speeds: Real, max_depth: float, seed: int = 0) -> LearnedLimits:
    """Compute the limits of mean structures (:func:`certified_lobes`) and of draws before and after learning.

    Parameters
    ----------
    learned
        Result of :func:`learned_in_turn`.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds.
    max_depth : m
        Largest axial depth that is searched.
    seed
        Seed of the choice of the draws.
    """
    prior = learned.prior
    before, after = (
        certified_lobes(*pair, spindle_speeds, max_depth) for pair in ((prior.model, prior.process), learned.updated())
    )
    bands = [
        _band(sample.chosen(SETTINGS.draws, seed), spindle_speeds, max_depth)
        for sample in (learned.before, learned.after)
    ]
    return LearnedLimits(before, after, *bands, max_depth)


def _band(draws: list[Draw], speeds: Real, max_depth: float) -> LimitBand:
    """Return the smallest and largest limit of draws; a draw that is not resolved lowers the band to 0."""
    limits = sampled_limits(draws, speeds, max_depth)
    return LimitBand(speeds, limits.min(axis=0), limits.max(axis=0), ("samples",) * len(speeds))


def learned_cut(
    learned: Learned, limits: LearnedLimits, *, confidence: float, drift: float, seed: int = 1
) -> RecommendedCut:
    """Recommend the cut with the largest removal rate that is stable in 39 draws (:func:`certified_cut`).

    Speeds are tried in the order of the lower end of the band. Its depth comes from other draws than the band, so that
    the choice of the best speed does not favour draws with large limits.

    Raises
    ------
    InputError
        Cuts that contradict each other or the model, or no cut with this confidence.
    """
    if learned.contradictions:
        raise InputError(
            "no cut is advised, as cuts contradict the model: check or leave out those named, or measure the tip again"
        )
    count = max(SETTINGS.draws, math.ceil(1 / (1 - confidence) - 1e-9) - 1)
    lowest = replace(limits.after, depth_limits=np.minimum(limits.after.depth_limits, limits.band_after.low))
    return certified_cut(
        *learned.updated(),
        lowest,
        np.zeros(len(lowest.depth_limits)),
        confidence=confidence,
        drift=drift,
        max_depth=limits.max_depth,
        given=learned.after.chosen(count, seed),
    )
