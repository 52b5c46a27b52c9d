"""Forces that repeat tell noise from a missing cause: what a residual repeats with them is no noise."""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft

from estimation import WindowedSpectrum, repeat_of

from ..models import Hypothesis, predict_lines

Real = NDArray[np.float64]

RUNG_OUT = 5.0
"""Time constants of the slowest mode after which noise that rings in it is forgotten."""

MOST = 0.25
"""Share of a residual's power that must repeat before it counts: a small error of a refit repeats too."""


def repeated_share(hypothesis: Hypothesis, lines: WindowedSpectrum) -> Real:
    """Share of each response's residual power that repeats with the forces, (n_responses,); 0 below :data:`MOST`.

    The residual r of the compared band is multiplied with itself one period T of the forces later:
    ``share = <r(t) r(t + T)> / <r^2>``; noise does not repeat, and a linear or nonlinear omission does.

    Parameters
    ----------
    hypothesis
        Hypothesis that predicts the response.
    lines
        Windowed lines of one recording. All shares are 0 where its forces do not repeat.
    """
    nothing = np.zeros(lines.measured.shape[1])
    decay = float((-hypothesis.model.poles.real).min())
    lag = repeat_of(lines.recording.force, int(RUNG_OUT / decay * lines.recording.rate), len(lines.window) // 2)
    if lag is None:
        return nothing
    spectrum = np.zeros((len(lines.window) // 2 + 1, len(nothing)), dtype=complex)
    spectrum[lines.band] = lines.measured - predict_lines(hypothesis, lines).response
    rest = irfft(spectrum, n=len(lines.window), axis=0)
    first, later = rest[:-lag], rest[lag:]
    power = np.mean(first**2 + later**2, axis=0) / 2
    share = np.mean(first * later, axis=0) / np.maximum(power, 1e-300)
    return np.asarray(np.where(share > MOST, share, 0.0))
