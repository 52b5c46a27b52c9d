"""Responses that a model, with its terms of physics, gives for the forces of a recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

from modal_fit import ModalModel

from .explanation import predict_lines
from .physics_terms import explanation_of
from .saturation import saturated
from .trial import Trial, band_of
from .windowed_lines import windowed_lines

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """Predicted beside measured responses.

    Parameters
    ----------
    response : (n_samples, n_responses)
        In the measured quantities; of frequencies up to half the sampling rate.
    run_in
        Samples at the beginning in which the structure's unknown first motion still rings.
    error : (n_responses,)
        Root mean square of measured minus predicted over that of measured, in the model's band after the run-in.
    total_error
        Of all responses together, each line of the band counting by its power.
    band
        Hz.
    """

    response: Real
    run_in: int
    error: Real
    total_error: float
    band: tuple[float, float]


def predict(model: ModalModel, trial: Trial) -> Prediction:
    """Simulate a recording's forces through a model and its terms of physics.

    A limit (``clipping``) is applied to its channel. A steady tone (``unmeasured_excitation``) has no known phase in
    another recording; its amplitude and phase are read from the recording at that one frequency.

    Raises
    ------
    FileFormatError
        Terms that cannot be read.
    InputError
        A recording that the model cannot be compared with.
    """
    explanation = explanation_of(model)
    band = band_of(model, trial.rate)
    decay = float((-model.poles.real).min())
    lines = windowed_lines(trial, band, decay)
    n = len(trial.force)
    response = irfft(predict_lines(explanation, lines).spectrum, n=lines.padded, axis=0)[:n]
    time = np.arange(n) / trial.rate
    for term in model.physics:
        if term["name"] == "unmeasured_excitation":
            frequency = float(term["parameters"]["frequency_hz"])
            response = response + _tone(trial.response - response, time, frequency, lines.start)
    for term in model.physics:
        if term["name"] == "clipping":
            column = trial.channels.index(term["location"]["channel"]) - trial.force.shape[1]
            limit, sharpness = (float(term["parameters"].get(name, np.inf)) for name in ("limit", "sharpness"))
            response[:, column] = saturated(response[:, column], limit, sharpness)
    measured, shown = (lines.cut(signal) for signal in (trial.response, response))
    rest, power = np.abs(measured - shown) ** 2, np.abs(measured) ** 2
    return Prediction(
        np.asarray(response),
        lines.start,
        np.sqrt(rest.sum(axis=0) / power.sum(axis=0)),
        float(np.sqrt(rest.sum() / power.sum())),
        band,
    )


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
