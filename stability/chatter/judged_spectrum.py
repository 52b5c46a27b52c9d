"""The spectrum in which a cut was judged, in the unit of its channel and small enough to be kept with the verdict."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .motion import Evidence

Real = NDArray[np.float64]

MOST_POINTS = 1500
"""Points of a stored spectrum; each is the largest of the lines that it stands for."""


@dataclass(frozen=True)
class CutSpectrum:
    """Spectrum of one channel in the second half of a recording, with the orders of the spindle apart.

    Parameters
    ----------
    channel
        Number of the channel among those that were judged.
    frequencies : (n_points,), Hz
        Frequencies of the points, increasing.
    amplitude : (n_points,)
        Root mean square of what does not repeat with the revolution, a line of resolution, in the unit of the samples;
        the largest within a point. NaN where an order of the spindle hides it.
    floor : (n_points,)
        Root mean square of the noise floor, a line of resolution, in the unit of the samples.
    order_frequencies, order_amplitudes : (n_orders,)
        Frequencies (Hz) and root mean squares of the orders of the spindle that were taken away.
    """

    channel: int
    frequencies: Real
    amplitude: Real
    floor: Real
    order_frequencies: Real
    order_amplitudes: Real


def cut_spectrum(evidence: Evidence, highest: float) -> CutSpectrum:
    """Give the spectrum of the channel in which lines stand out most, up to a frequency.

    Parameters
    ----------
    evidence
        Evidence of the recording, from :func:`gather_evidence`.
    highest : Hz
        Highest frequency to show; no more than was searched is shown.
    """
    spectrum, spindle = evidence.spectrum, evidence.track.mean_frequency
    channel = _channel(evidence)
    scale = float(evidence.scales[channel])
    searched = spectrum.searched
    top = min(highest, float(spectrum.orders[searched][-1]) * spindle)
    shown = spectrum.orders * spindle <= top
    left = np.where(searched, spectrum.power[:, channel], np.nan)[shown]
    power, middles = _largest(left), _largest(spectrum.orders[shown] * spindle)
    floor = _largest(spectrum.floor[shown, channel])
    turn = evidence.late.mean_turn[:, channel]
    orders = np.asarray(np.sqrt(2) * np.abs(np.fft.rfft(turn)) / len(turn), dtype=float)
    places = np.arange(len(orders), dtype=float) * spindle
    kept = (places > 0) & (places <= top)
    return CutSpectrum(
        channel, middles, scale * np.sqrt(power), scale * np.sqrt(floor), places[kept], scale * orders[kept]
    )


def _channel(evidence: Evidence) -> int:
    """Choose the channel in which the strongest line has its largest share; without lines, where least repeats."""
    if evidence.families:
        return int(np.argmax(evidence.families[0].lines[0].amplitude / evidence.late.size))
    return int(np.argmax(evidence.late.residual.std(axis=0) / evidence.late.size))


def _largest(values: Real) -> Real:
    """Give at most `MOST_POINTS` points, each the largest of equally many neighbours; NaN where all are."""
    each = -(-len(values) // MOST_POINTS)
    padded = np.concatenate([values, np.full(-len(values) % each, np.nan)]).reshape(-1, each)
    largest = np.where(np.isnan(padded), -np.inf, padded).max(axis=1)
    return np.where(np.isfinite(largest), largest, np.nan)
