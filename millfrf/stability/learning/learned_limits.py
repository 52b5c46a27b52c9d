"""Depth limits before and after learning with their bands, and the cut that they advise."""

import math
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real

from ..certification import certified_numerics
from ..drawn_structures import Draw
from ..limit_interval import LimitBand, sampled_limits
from ..lobes_result import StabilityLobes
from ..recommendation import RecommendedCut, certified_cut
from ..robust_depth import with_band
from ..settings import SETTINGS
from .learned import Learned
from .sample import Sample


@dataclass(frozen=True)
class BandedLimits:
    """Limits of a mean structure and cut, and the 95 % interval from draws.

    Parameters
    ----------
    lobes
        Limits of the mean.
    band
        Smallest and largest limit of 39 draws, with the correlations of structure and coefficients.
    max_depth : m
        Largest depth that was searched.
    """

    lobes: StabilityLobes
    band: LimitBand
    max_depth: float


def prior_limits(learned: Learned, spindle_speeds: Real, max_depth: float, seed: int = 0) -> BandedLimits:
    """Compute the limits before learning; parameters as :func:`learned_limits`."""
    prior = learned.prior
    return _banded((prior.model, prior.process), learned.before, spindle_speeds, max_depth, seed)


def learned_limits(learned: Learned, spindle_speeds: Real, max_depth: float, seed: int = 0) -> BandedLimits:
    """Compute the limits after learning.

    Parameters
    ----------
    learned
        Result of :func:`learned_in_turn`.
    spindle_speeds : (n_speeds,), rad/s
        Spindle speeds of the limits.
    max_depth : m
        Largest axial depth that is searched.
    seed
        Seed of the choice of the draws.
    """
    return _banded(learned.updated(), learned.after, spindle_speeds, max_depth, seed)


def _banded(mean: Draw, sample: Sample, speeds: Real, max_depth: float, seed: int) -> BandedLimits:
    """Return the certified limits of the mean, with their band; a draw that is not resolved lowers it to 0."""
    lobes = with_band(*mean, certified_numerics(*mean, speeds, max_depth), max_depth)
    limits = sampled_limits(sample.chosen(SETTINGS.draws, seed), speeds, max_depth)
    band = LimitBand(speeds, limits.min(axis=0), limits.max(axis=0), ("samples",) * len(speeds))
    return BandedLimits(lobes, band, max_depth)


def learned_cut(
    learned: Learned, limits: BandedLimits, *, confidence: float, drift: float, seed: int = 1
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
    lowest = replace(limits.lobes, depth_limits=np.minimum(limits.lobes.depth_limits, limits.band.low))
    return certified_cut(
        *learned.updated(),
        lowest,
        np.zeros(len(lowest.depth_limits)),
        confidence=confidence,
        drift=drift,
        max_depth=limits.max_depth,
        given=learned.after.chosen(count, seed),
    )
