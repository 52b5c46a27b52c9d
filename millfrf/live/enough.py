"""Amount of data: for each band of frequencies, the share of lines whose FRF is as sure as was planned."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, to_receptance


@dataclass(frozen=True)
class BandProgress:
    """Progress in one band of frequencies.

    Parameters
    ----------
    low, high : Hz
        Lower and upper end of the band.
    share
        Share of its known lines that reach the wanted error, 0 ... 1.
    error
        Median over the known lines of the error over the wanted one; below 1 is enough; infinite where none is known.
    known
        Share of its lines on which the FRF is known, 0 ... 1.
    """

    low: float
    high: float
    share: float
    error: float
    known: float = 1.0

    @property
    def done(self) -> float:
        """Share of the data that the wanted error needs, 0 ... 1: an error falls with the root of the averages."""
        return min(1.0, 1.0 / self.error**2) if self.error > 0 else 1.0

    @property
    def enough(self) -> bool:
        """Whether at least nine tenths of the lines are known and nine tenths of those reach the wanted error."""
        return self.share >= 0.9 and self.known >= 0.9


def band_progress(
    frf: Frf | None,
    band: tuple[float, float],
    n_bands: int,
    *,
    known: NDArray[np.bool_] | None = None,
    relative: float,
    absolute: float | None = None,
) -> tuple[BandProgress, ...]:
    """Judge an FRF's error band by band.

    Parameters
    ----------
    frf
        FRF with its covariance; None: nothing is known yet.
    band : Hz
        Lowest and highest frequency; the band is cut into parts of equal width.
    n_bands
        Number of parts.
    known : (n_lines,), bool
        Lines on which the FRF says something; None: all that are valid.
    relative
        Wanted standard deviation of a column of the FRF over its length (2-norm over the responses).
    absolute
        Instead, the largest standard deviation of any entry of the receptance, m/N, that was planned.
    """
    edges = np.linspace(band[0], band[1], n_bands + 1)
    pairs = list(pairwise(edges))
    if frf is None or frf.covariance is None:
        return tuple(BandProgress(float(low), float(high), 0.0, float("inf"), 0.0) for low, high in pairs)
    reached = _worst(frf, relative, absolute)
    counted = frf.valid if known is None else known
    found = []
    for low, high in pairs:
        inside = (frf.frequencies >= low) & (frf.frequencies < high) & (frf.frequencies > 0)
        errors = reached[inside & counted]
        share = float(np.mean(errors <= 1)) if len(errors) else 0.0
        middle = float(np.median(errors)) if len(errors) else float("inf")
        covered = float(np.mean(counted[inside])) if inside.any() else 0.0
        found.append(BandProgress(float(low), float(high), share, middle, covered))
    return tuple(found)


def _worst(frf: Frf, relative: float, absolute: float | None) -> np.ndarray:
    """Error over the wanted one, the worst entry or column of each line; infinite where there is no FRF."""
    judged = frf if absolute is None else to_receptance(frf)
    assert judged.covariance is not None
    variance = judged.covariance.variance()
    if absolute is not None and judged.quantity == "receptance":
        error = np.sqrt(variance.max(axis=(1, 2))) / absolute
    else:
        size = np.sum(np.abs(judged.values) ** 2, axis=1)
        ratio = np.divide(variance.sum(axis=1), size, out=np.full(size.shape, np.inf), where=size > 0)
        error = np.sqrt(ratio.max(axis=1)) / relative
    return np.where(judged.valid, error, np.inf)
