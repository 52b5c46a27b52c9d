"""Significance of many residual cells at once, where the noise level itself is uncertain."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import polygamma
from scipy.stats import f as fisher

from ..inference import LOCATION

Real = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseSpread:
    """How well the noise model meets the noise level of single cells.

    Parameters
    ----------
    level
        Typical ratio of residual power to noise power where the model is at its best, at least 1.
    spread
        Standard deviation of the ratio's logarithm beyond chance.
    """

    level: float
    spread: float

    def chance(self, ratio: ArrayLike, count: ArrayLike) -> Real:
        """Return the probability of a larger ratio in a cell of ``count`` independent lines of noise (F test)."""
        numerator = np.maximum(2 * np.asarray(count, dtype=float), 1e-9)
        return np.asarray(fisher.sf(np.asarray(ratio) / self.level, numerator, 2 / self.spread**2))


def noise_spread(
    ratio: Real, count: Real, least: float = LOCATION.least_spread, most: float = LOCATION.quiet_spread
) -> NoiseSpread:
    """Return level and spread of the cells that the final model leaves, by median and median deviation.

    Where the model leaves much, cells scatter by what is left and not by how well noise is known: with that spread
    nothing would ever stand out of it.

    Parameters
    ----------
    ratio
        Residual power over noise power of each cell, any shape.
    count
        Independent complex lines of each cell, in the shape of ``ratio``.
    least
        Least spread, however well the cells agree.
    most
        Largest spread, however far they scatter.
    """
    logs = np.log(np.maximum(ratio, 1e-12)).ravel()
    middle = float(np.median(logs))
    scatter = (1.4826 * float(np.median(np.abs(logs - middle)))) ** 2
    chance = float(np.median(polygamma(1, np.maximum(count, 0.5).ravel())))
    spread = float(np.sqrt(max(scatter - chance, least**2)))
    return NoiseSpread(max(1.0, float(np.exp(middle))), min(spread, max(most, least)))


def holm(chances: Real) -> Real:
    """Return adjusted p-values that control the family-wise error (Holm 1979, Scand. J. Statistics 6).

    Examples
    --------
    >>> [round(float(p), 3) for p in holm(np.array([0.01, 0.04, 0.03]))]
    [0.03, 0.06, 0.06]
    """
    flat = np.asarray(chances, dtype=float).ravel()
    order = np.argsort(flat)
    raised = np.maximum.accumulate(flat[order] * np.arange(len(flat), 0, -1))
    adjusted = np.empty(len(flat))
    adjusted[order] = np.minimum(raised, 1.0)
    return adjusted.reshape(np.shape(chances))
