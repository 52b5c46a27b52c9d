"""Responses that a model, with its terms of physics, gives for the forces of a recording."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft

from estimation import BandRecording, windowed_spectrum
from modal_fit import ModalModel

from ...faults import with_faults
from ...models import hypothesis_of, predict_lines
from ...records import band_of, in_deflections, without_delay

Real = NDArray[np.float64]


@dataclass(frozen=True)
class Prediction:
    """Predicted beside measured responses.

    Parameters
    ----------
    response : (n_samples, n_responses)
        Predicted responses in the measured quantities, with frequencies up to half the sampling rate.
    run_in
        Samples at the beginning in which the structure's unknown first motion still rings.
    error : (n_responses,)
        Root mean square of measured minus predicted over that of measured, in the model's band after the run-in.
    total_error
        Error of all responses together; each line of the band counts by its power.
    band
        Lowest and highest frequency that are compared, Hz.
    """

    response: Real
    run_in: int
    error: Real
    total_error: float
    band: tuple[float, float]


def predict(model: ModalModel, trial: BandRecording) -> Prediction:
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
    model, (trial,) = without_delay(in_deflections(model), [trial])
    hypothesis = hypothesis_of(model)
    band = band_of(model, trial.rate)
    decay = float((-model.poles.real).min())
    lines = windowed_spectrum(trial, band, decay)
    n = len(trial.force)
    response = np.asarray(irfft(predict_lines(hypothesis, lines).spectrum, n=lines.padded, axis=0)[:n])
    response = with_faults(response, trial, lines.start, model.physics)
    measured, shown = (lines.cut(signal) for signal in (trial.response, response))
    rest, power = np.abs(measured - shown) ** 2, np.abs(measured) ** 2
    return Prediction(
        np.asarray(response),
        lines.start,
        np.sqrt(rest.sum(axis=0) / power.sum(axis=0)),
        float(np.sqrt(rest.sum() / power.sum())),
        band,
    )
