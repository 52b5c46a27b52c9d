"""Envelopes of narrow bands: noise of a stable cut, or a limit cycle whose frequency may wander."""

import math
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Complex, Real

from ..settings import THRESHOLDS
from .spindle import Revolutions

_BLOCK = 8  # values over which the size of a vibration is taken to be constant
_STARTS = 4  # first values from which the independent ones are taken, whose results are averaged


@dataclass(frozen=True)
class BandEnvelope:
    """Test of the envelope of the motion in a narrow band.

    The envelope of noise through modes is that of a Gaussian process: its power is exponentially distributed. That of a
    limit cycle is steady, also where its frequency wanders and its line is wide.
    """

    share: float  # root mean square of the motion in the band over that of all motion
    degrees: int  # degrees of freedom of the test: number of independent values, less one a block
    teeth: int  # of the cutter; 1: an edge that may stay in the cut
    p_value: float  # probability that noise has an envelope as steady

    @property
    def is_steady(self) -> bool:
        """Check whether the envelope is steadier than that of noise."""
        return self.p_value < THRESHOLDS.line_p_value

    @property
    def is_noise(self) -> bool:
        """Check whether the envelope fluctuates as that of noise does, in so many values that it would show a cycle.

        A single edge stays in the cut, whose depth an eccentric workpiece changes over each turn: there chatter rises
        and falls as noise does.
        """
        return (
            self.teeth > 1 and self.degrees >= THRESHOLDS.envelope_degrees and self.p_value > THRESHOLDS.noise_p_value
        )


def band_envelope(revolutions: Revolutions, order: float, weights: Real) -> BandEnvelope:
    """Test the envelope of what does not repeat, in a band around an order.

    Powers of independent instants, divided into blocks, are compared with exponential ones by Bartlett's statistic
    (Moran, J. R. Stat. Soc. B 13, 1951): -2 times the sum of the logarithms of power over mean power of the block,
    which has a chi-squared distribution under noise. The number of independent instants is that of the band's own
    spectrum.

    Parameters
    ----------
    revolutions
        Part of the recording.
    order
        Middle of the band.
    weights : (n_quantities, n_channels)
        As in :func:`.lines.share_of`.
    """
    spectrum = np.fft.rfft(revolutions.residual, axis=0) / len(revolutions.residual)
    width = float(_half_widths(np.array(order), revolutions.teeth))
    return _tested(spectrum, revolutions, (order - width, order + width), weights)


def noise_share(revolutions: Revolutions, weights: Real) -> float:
    """Return the size, over that of all motion, of what does not repeat and fluctuates as noise does.

    Bands are taken from the spectrum, the largest first. Chatter is concentrated in lines, whose bands hold few
    independent values and are no noise.
    """
    spectrum = np.fft.rfft(revolutions.residual, axis=0) / len(revolutions.residual)
    orders = np.arange(len(spectrum)) / revolutions.count
    widths = _half_widths(orders, revolutions.teeth)
    power = (2 * np.abs(spectrum) ** 2 @ weights.T).max(axis=1)
    low, high = np.searchsorted(orders, orders - widths), np.searchsorted(orders, orders + widths, side="right")
    inside = (orders + widths < revolutions.highest_order) & (low > 0)
    noise = 0.0
    while True:
        total = np.concatenate([[0.0], np.cumsum(power)])
        bands = np.where(inside, total[high] - total[low], 0.0)
        middle = int(np.argmax(bands))
        if bands[middle] < THRESHOLDS.band_share**2:
            return math.sqrt(noise)
        ends = (float(orders[middle] - widths[middle]), float(orders[middle] + widths[middle]))
        if _tested(spectrum, revolutions, ends, weights).is_noise:
            noise += float(bands[middle])
        power[low[middle] : high[middle]] = 0.0


def _half_widths(orders: Real, teeth: int) -> Real:
    """Return half widths of bands around orders, which hold one line of chatter that the tooth passing modulates."""
    return np.minimum(THRESHOLDS.band_width * orders, teeth / 2)


def _tested(spectrum: Complex, revolutions: Revolutions, ends: tuple[float, float], weights: Real) -> BandEnvelope:
    """Test the envelope between two orders of the spectrum of a recording."""
    count, teeth = revolutions.count, revolutions.teeth
    band = spectrum[math.ceil(ends[0] * count) : math.floor(ends[1] * count) + 1]
    share = math.sqrt(float(np.max(weights @ np.sum(2 * np.abs(band) ** 2, axis=0), initial=0.0)))
    if len(band) < 2:
        return BandEnvelope(share, 0, teeth, 1.0)
    left, sizes, right = np.linalg.svd(np.fft.ifft(band, axis=0), full_matrices=False)
    power = np.abs(left[:, 0] * sizes[0]) ** 2
    lines = np.abs(band @ right[0].conj()) ** 2
    # the mean of a squared periodogram of noise is twice the square of the mean
    independent = min(len(power), 2 * float(lines.sum()) ** 2 / max(float(np.sum(lines**2)), 1e-300))
    step = len(power) / independent
    sums, degrees = [], 0
    for start in np.arange(_STARTS) / _STARTS:
        places = ((np.arange(int(independent)) + start) * step).astype(int)
        statistic, degrees = _bartlett(power[places[places < len(power)]])
        sums.append(statistic)
    p_value = float(scipy.stats.chi2.cdf(np.mean(sums), degrees)) if degrees else 1.0
    return BandEnvelope(share, degrees, teeth, p_value)


def _bartlett(power: Real) -> tuple[float, int]:
    """Return the sum of Bartlett's statistic over blocks of powers, and its degrees of freedom."""
    total, degrees = 0.0, 0
    for block in np.array_split(power, max(1, len(power) // _BLOCK)):
        size = len(block)
        if size > 1 and block.min() > 0:
            logarithm = np.log(block / block.mean()).sum()
            total -= 2 * float(logarithm) / (1 + (size + 1) / (6 * size))
            degrees += size - 1
    return total, degrees
