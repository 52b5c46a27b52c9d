"""A mode's trend over one label in all poses together."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import t as student

from .trends import Trend

Real = NDArray[np.float64]

LEAST_POSES = 3
"""Poses without which a trend of all is not told from one of each."""


@dataclass(frozen=True)
class PooledTrend:
    """Mean slope of a mode's quantity over one label, and how it differs between poses.

    Parameters
    ----------
    mode, frequency
        Number of the mode in the campaign, and its mean natural frequency over these poses, Hz.
    quantity, label
        Quantity that changes, and the label.
    poses
        Number of poses.
    slope, error
        Mean change of the logarithm a unit of the label, and its standard error, differences between poses included.
    between
        Standard deviation of the slope between poses.
    span
        Median range of the label in a pose.
    p_value
        Two-sided probability of a mean slope as large where there is none.
    """

    mode: int
    frequency: float
    quantity: str
    label: str
    poses: int
    slope: float
    error: float
    between: float
    span: float
    p_value: float

    @property
    def change(self) -> float:
        """Relative change over the median range of the label."""
        return float(np.expm1(self.slope * self.span))

    @property
    def half_width(self) -> float:
        """Half width of the 95 % interval of the change."""
        return float(student.ppf(0.975, self.poses - 1) * self.error * self.span * (1 + self.change))


def pool(trends: Sequence[Trend]) -> PooledTrend | None:
    """Mean slope over poses with the interval of Hartung and Knapp (Stat. Med. 20, 2001); None below three poses.

    Slopes differ between poses with a variance after Paule and Mandel, so that one pose that drifts does not make all
    of them drift. The error is never smaller than that of equal slopes.

    Parameters
    ----------
    trends
        Trends of one mode's quantity over one label, one a pose.
    """
    told = [one for one in trends if np.isfinite(one.error) and one.error > 0]
    if len(told) < LEAST_POSES:
        return None
    slopes, errors = np.array([one.slope for one in told]), np.array([one.error for one in told])
    between = _between(slopes, errors)
    weights = 1 / (errors**2 + between**2)
    slope = float(np.average(slopes, weights=weights))
    spread = float(np.sum(weights * (slopes - slope) ** 2) / (len(told) - 1))
    error = float(np.sqrt(max(spread, 1.0) / weights.sum()))
    first = told[0].series
    frequencies = [one.series.frequency for one in told]
    span = float(np.median([np.ptp(one.values) for one in told]))
    p_value = float(2 * student.sf(abs(slope) / error, len(told) - 1))
    return PooledTrend(
        first.mode,
        float(np.exp(np.mean(np.log(frequencies)))) if first.mode else float("nan"),
        first.quantity,
        told[0].label,
        len(told),
        slope,
        error,
        between,
        span,
        p_value,
    )


def _between(slopes: Real, errors: Real) -> float:
    """Standard deviation between poses with which the slopes scatter as they should; 0 where errors explain it."""

    def excess(between: float) -> float:
        weights = 1 / (errors**2 + between**2)
        mean = np.average(slopes, weights=weights)
        return float(np.sum(weights * (slopes - mean) ** 2)) - (len(slopes) - 1)

    if excess(0.0) <= 0:
        return 0.0
    return float(brentq(excess, 0.0, 10 * float(np.ptp(slopes)) + 1e-300))
