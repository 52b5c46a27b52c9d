"""Tests whether a residual follows the predicted response with a gain and a lag that change during a recording."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Real

from ..models.hypothesis import Hypothesis
from ..models.settings import RESIDUAL
from .structured_residual import prediction_and_residual

PARTS = 8  # parts of a recording, each with a gain and a lag of its own

SHIFTS = np.linspace(0.1, 0.9, 33)  # shifts of the prediction in time, as shares of the recording

FADED = 0.1  # share of the recording that fades in and out


@dataclass(frozen=True)
class ChangeInTime:
    """Response whose gain or lag against the model changes during a recording."""

    recording: str
    response: str
    share: float  # share of the residual power that the changes explain beyond chance
    spread: float  # that share in standard deviations of chance

    @property
    def sentence(self) -> str:
        """Warning for the reader of a diagnosis."""
        return (
            f"{100 * self.share:.0f} % of the residual of {self.response} in {self.recording} is the predicted "
            f"response with a gain and a delay that change during the recording ({self.spread:.0f} standard deviations "
            "beyond chance): look for lost samples, an amplifier that drifts or a structure that warms up"
        )


def changes_in_time(
    hypothesis: Hypothesis, recordings: Sequence[WindowedSpectrum], most: float
) -> tuple[ChangeInTime, ...]:
    r"""Return the responses whose gain or lag changes during a recording by more than chance.

    In part k of a recording, the residual r follows the predicted response y of the compared band,

    .. math:: r(t) = a_k\,y(t) + b_k\,\hat y(t) + \text{noise}

    with the Hilbert transform of y, so that a is an error of the gain and b a lag. The statistic is the power that this
    explains beyond the same a and b in all parts, as errors of a linear model do not change. Noise that passes through
    lightly damped modes resembles a prediction by chance; shifts of the prediction in time show how much. A single
    steady tone is the same after each shift, so that no change of its gain is significant.

    Parameters
    ----------
    hypothesis, recordings
        Model and windowed spectra.
    most
        Share of the residual power beyond chance from which a change is returned.
    """
    changes = []
    for lines in recordings:
        predicted, residual = (_in_band(signal, lines) for signal in prediction_and_residual(hypothesis, lines))
        for p, channel in enumerate(lines.recording.responses):
            rest, shown = residual[:, p], predicted[:, p]
            late = scipy.fft.irfft(-1j * scipy.fft.rfft(shown), n=len(shown))
            explained = _explained(rest, shown, late)
            shifts = (SHIFTS * len(rest)).astype(int)
            by_chance = np.array([_explained(rest, np.roll(shown, k), np.roll(late, k)) for k in shifts])
            share, scatter = explained - float(by_chance.mean()), float(by_chance.std(ddof=1))
            if share > most and share > RESIDUAL.change_errors * scatter:
                changes.append(ChangeInTime(lines.recording.name, channel.name, share, share / scatter))
    return tuple(changes)


def _in_band(signal: Real, lines: WindowedSpectrum) -> Real:
    """Return a signal (n, n_responses) in the compared band, faded at its ends."""
    count = len(signal)
    spectrum = scipy.fft.rfft(signal * scipy.signal.windows.tukey(count, FADED)[:, None], axis=0)
    frequencies = scipy.fft.rfftfreq(count, 1 / lines.recording.rate)
    spectrum[(frequencies < lines.frequencies[0]) | (frequencies > lines.frequencies[-1])] = 0
    return np.asarray(scipy.fft.irfft(spectrum, n=count, axis=0))


def _explained(rest: Real, shown: Real, late: Real) -> float:
    """Return the share of the power of the residual that numbers of each part explain beyond common numbers."""
    first = np.linspace(0, len(rest), PARTS, endpoint=False).astype(int)
    products = np.stack([shown**2, shown * late, late**2, shown * rest, late * rest])
    sums = np.add.reduceat(products, first, axis=1)
    return float(_power(sums).sum() - _power(sums.sum(axis=1))) / max(float(rest @ rest), 1e-300)


def _power(sums: Real) -> Real:
    """Return the power that a combination of prediction and Hilbert transform explains.

    ``sums`` holds ``y^2``, ``y h``, ``h^2``, ``y r`` and ``h r``, (5, ...).
    """
    yy, yh, hh, yr, hr = sums
    determinant = yy * hh - yh**2
    explained = yr**2 * hh - 2 * yr * hr * yh + hr**2 * yy
    # a part without a prediction, such as the silence after a blow, explains nothing
    return np.asarray(np.where(determinant > 1e-12 * yy * hh, explained / np.maximum(determinant, 1e-300), 0.0))
