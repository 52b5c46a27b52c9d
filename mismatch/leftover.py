"""Is what remains noise? Noise stays when the signal goes; an omission comes and goes with it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft
from scipy.optimize import nnls
from scipy.signal import ShortTimeFFT
from scipy.signal.windows import hann

from .explanation import Explanation, predict_lines
from .windowed_lines import WindowedLines

Real = NDArray[np.float64]

SEGMENT = 2.0
"""Length of a segment, s, at least twenty periods of nothing in particular: half a hertz apart."""

BINS = 12
"""Neighbouring bins that share one noise level."""


@dataclass(frozen=True)
class Leftover:
    """What of a residual moves with the signal.

    Parameters
    ----------
    share
        Of the residual's power, 0 (noise) to 1.
    power
        The same power as a share of the response's, mean over channels and recordings.
    """

    share: float
    power: float


def leftover(explanation: Explanation, lines: list[WindowedLines]) -> Leftover:
    """How much of the residual moves with the predicted response.

    In cells of time and frequency the residual's power is regressed, with non-negative factors, on a constant (noise of
    that band), on the predicted power in the same cell and on the predicted power of all frequencies at the same time
    (what a nonlinearity spreads). The share is what the last two carry, less what they carry when the prediction is
    shifted in time against the residual, as chance does.

    Parameters
    ----------
    explanation
        After all that was found.
    lines
        Recordings.
    """
    shares, powers = [], []
    for one in lines:
        predicted = predict_lines(explanation, one)
        n = len(one.trial.force)
        shown = irfft(predicted.spectrum, n=one.padded, axis=0)[:n]
        rest = (one.trial.response - shown)[one.start : n - int(one.trial.rate) // 2]
        shown = shown[one.start : n - int(one.trial.rate) // 2]
        for p in range(rest.shape[1]):
            r, s = _powers(rest[:, p], one), _powers(shown[:, p], one)
            own = _moving(r, s)
            chance = np.median([_moving(r, np.roll(s, shift, axis=1)) for shift in _shifts(s.shape[1])])
            moving = min(max(own - float(chance), 0.0), float(np.sum(r)))
            shares.append(moving / float(np.sum(r)))
            powers.append(moving / float(np.sum(s)))
    return Leftover(float(np.mean(shares)), float(np.mean(powers)))


def _shifts(count: int) -> list[int]:
    return [max(1, round(count * share)) for share in (0.29, 0.43, 0.61, 0.77)]


def _powers(signal: Real, lines: WindowedLines) -> Real:
    """Power in cells, (n_bins, n_segments), in the band that is compared."""
    length = int(SEGMENT * lines.trial.rate)
    transform = ShortTimeFFT(hann(length, sym=False), length // 2, lines.trial.rate)
    power = np.abs(transform.stft(signal, p0=1, p1=len(signal) // (length // 2))) ** 2
    inside = (transform.f >= lines.frequencies[0]) & (transform.f <= lines.frequencies[-1])
    return np.asarray(power[inside])


def _moving(rest: Real, shown: Real) -> float:
    """Power of the residual that the prediction's power accounts for."""
    moving = 0.0
    together = shown.mean(axis=0)
    for start in range(0, len(rest), BINS):
        cells, same = rest[start : start + BINS], shown[start : start + BINS]
        broad = np.broadcast_to(together, cells.shape)
        columns = np.stack([np.ones(cells.size), same.ravel(), broad.ravel()], axis=1)
        scale = np.maximum(columns.mean(axis=0), 1e-300)
        # cells of noise scatter like their level: weigh by it, once from the mean and once from the first fit
        weight = np.full(cells.size, 1 / max(float(cells.mean()), 1e-300))
        factors = np.zeros(3)
        for _ in range(3):
            factors = nnls(columns / scale * weight[:, None], cells.ravel() * weight)[0]
            fitted = columns / scale @ factors
            weight = 1 / np.maximum(fitted, 0.1 * float(cells.mean()))
        moving += cells.size * float(factors[1] + factors[2])
    return moving
