"""What plain faults do to a predicted response: a tone is in it, a channel saturates."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import rfft

from estimation import BandRecording

from .saturation import saturated

Real = NDArray[np.float64]
Term = Mapping[str, Any]

FAULTS = ("unmeasured_excitation", "clipping")
"""Names of causes that are no part of an explanation."""


def with_faults(response: Real, trial: BandRecording, start: int, terms: Sequence[Term]) -> Real:
    """A predicted response with the plain faults of a recording.

    A steady tone has no known phase in another recording: amplitude and phase are read from the recording at that one
    frequency. A limit is applied to its channel.

    Parameters
    ----------
    response : (n_samples, n_responses)
        Without faults.
    trial
        The recording.
    start
        First sample after the run-in.
    terms
        ``{name, location, parameters}`` of causes; others than faults are passed over.
    """
    time = np.arange(len(response)) / trial.rate
    for term in terms:
        if term["name"] == "unmeasured_excitation":
            frequency = float(term["parameters"]["frequency_hz"])
            response = response + _tone(trial.response[: len(response)] - response, time, frequency, start)
    for term in terms:
        if term["name"] == "clipping":
            response = response.copy()
            column = trial.channels.index(term["location"]["channel"]) - trial.force.shape[1]
            limit, sharpness = (float(term["parameters"].get(name, np.inf)) for name in ("limit", "sharpness"))
            response[:, column] = saturated(response[:, column], limit, sharpness)
    return response


def _tone(rest: Real, time: Real, frequency: float, start: int) -> Real:
    """Sinusoid of the frequency nearest ``frequency`` that is in the residual, (n_samples, n_responses)."""
    kept, late = rest[start:], time[start:]
    fine = 8 * len(kept)
    spectrum = np.abs(rfft(kept * np.hanning(len(kept))[:, None], n=fine, axis=0)) ** 2
    axis = np.arange(fine // 2 + 1) / fine / (late[1] - late[0])
    near = np.abs(axis - frequency) < 2.0 / (late[-1] - late[0])
    exact = float(axis[near][np.argmax(spectrum[near].sum(axis=1))]) if near.any() else frequency
    waves = np.column_stack([np.cos(2 * np.pi * exact * time), np.sin(2 * np.pi * exact * time)])
    return np.asarray(waves @ np.linalg.lstsq(waves[start:], kept, rcond=None)[0])
