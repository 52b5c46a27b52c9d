"""Peaks of the measured response: whether a pole stands at one of its own."""

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from ..settings import SETTINGS
from .measured_lines import MeasuredLines, half_power_lines


def peak_rise(pole: complex, own: NDArray[np.bool_], lines: MeasuredLines) -> float:
    """Return the response at the peak of a pole over that in the dips on both sides of it, as a ratio of amplitudes.

    The response is the root of the power summed over all entries of the FRF matrix, in their unit. Each dip is the
    least response between the peak and a higher one, or the end of the lines, on that side. The result is 1 where the
    pole has no peak; three standard errors of the noise are deducted.

    Parameters
    ----------
    pole : rad/s
        Pole whose peak is looked for, within its half-power band.
    own : (n_lines,), bool
        Lines whose peak belongs to this pole and to no other mode.
    lines
        Lines of the FRF matrix.
    """
    width = int(np.clip(SETTINGS.peak_smoothing * -pole.real / (2 * np.pi) / lines.spacing, 1, len(lines.s)))
    weighted = np.sum(np.abs(lines.values) ** 2, axis=(1, 2))
    summed = np.sum(np.abs(lines.entries) ** 2, axis=(1, 2))
    power, noise = _smoothed(summed, width), _smoothed(lines.noise * summed / np.maximum(weighted, 1e-300), width)
    top = np.zeros(len(power), dtype=bool)
    top[1:-1] = (power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])
    maxima = np.flatnonzero(top & own & half_power_lines(pole, lines))
    prominences = scipy.signal.peak_prominences(power, maxima)[0]
    sure = power[maxima] - 3 * np.sqrt(2 * power[maxima] * noise[maxima] / width)
    dip = np.maximum(power[maxima] - prominences, np.maximum(noise[maxima], 1e-300))
    return float(np.sqrt(np.maximum(sure, 0.0) / dip).max(initial=1.0))


def _smoothed(power: Real, width: int) -> Real:
    """Return the running mean over ``width`` lines; the window is shorter at the ends."""
    summed = np.concatenate([[0.0], np.cumsum(power)])
    first = np.maximum(np.arange(len(power)) - (width - 1) // 2, 0)
    last = np.minimum(np.arange(len(power)) + width // 2 + 1, len(power))
    return np.asarray((summed[last] - summed[first]) / (last - first))
