"""A steady tone from elsewhere: a pump, a fan, a machine nearby, hum of the mains."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from estimation import BandRecording

from .protocol import Parameter

Real = NDArray[np.float64]


class UnmeasuredExcitation:
    """The responses hold a sinusoid that no measured force explains."""

    order = 0
    name = "unmeasured_excitation"
    equation = "y_shown = y + A cos(2 pi f t + phi)"
    source = "Bendat & Piersol, Random Data, 4th ed., section 6.1.4 (extraneous noise)"
    parameters: tuple[Parameter, ...] = (Parameter("frequency_hz", "Hz", 0.01, 0.0),)
    confusable_with = ("missing_mode",)

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) with the tone.

        A steady tone has no known phase in another recording: amplitude and phase are read from the recording at that
        one frequency.
        """
        time = np.arange(len(response)) / recording.rate
        rest = recording.response[: len(response)] - response
        return response + tone_of(rest, time, float(term["parameters"]["frequency_hz"]), start)


def tone_of(rest: Real, time: Real, frequency: float, start: int) -> Real:
    """Return the sinusoid in a residual whose frequency is near a given one, (n_samples, n_responses).

    Parameters
    ----------
    rest : (n_samples, n_responses)
        Residual that holds the tone.
    time : (n_samples,), s
        Times of the samples.
    frequency
        Frequency near which the strongest line is taken, Hz.
    start
        First sample after the run-in.
    """
    kept, late = rest[start:], time[start:]
    fine = 8 * len(kept)
    spectrum = np.abs(rfft(kept * np.hanning(len(kept))[:, None], n=fine, axis=0)) ** 2
    axis = np.arange(fine // 2 + 1) / fine / (late[1] - late[0])
    near = np.abs(axis - frequency) < 2.0 / (late[-1] - late[0])
    exact = float(axis[near][np.argmax(spectrum[near].sum(axis=1))]) if near.any() else frequency
    waves = np.column_stack([np.cos(2 * np.pi * exact * time), np.sin(2 * np.pi * exact * time)])
    return np.asarray(waves @ np.linalg.lstsq(waves[start:], kept, rcond=None)[0])


PHYSICS = UnmeasuredExcitation()
