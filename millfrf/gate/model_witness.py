"""A model and the recordings that it is to describe, as witnesses of each other."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import BandRecording, h1, spectra_for_judging
from millfrf.core import Band, InputError, Real
from millfrf.mismatch import predict
from modal_fit import ModalModel

from .settings import GATE


@dataclass(frozen=True)
class Misfit:
    """What a prediction of one response leaves, in the band.

    Parameters
    ----------
    share
        Root mean square of that part of the error that follows the forces, over that of the response.
    p_value
        Probability that noise follows the forces as well as the error does.
    """

    share: float
    p_value: float


def misfits(recording: BandRecording, predicted: Real, band: Band) -> list[Misfit]:
    """Compare measured with predicted responses: noise does not follow the forces, an error of the model does.

    The multiple coherence g of the error with m forces over n averages is tested line by line by
    ``F = g (n - m) / ((1 - g) m)`` (Bendat & Piersol, Random Data, 4th ed., section 7.3); the p-values are combined by
    Fisher's method.

    Parameters
    ----------
    recording
        Forces and measured responses.
    predicted : (n_samples, n_responses)
        Responses of the model to the same forces, in the measured quantities and units.
    band : Hz
        Lines that are compared.
    """
    (errors,) = spectra_for_judging([replace(recording, response=recording.response - predicted)])
    (measured,) = spectra_for_judging([recording])
    inside = (errors.frequencies >= band[0]) & (errors.frequencies <= band[1])
    m, n = len(recording.excitations), errors.effective_averages
    coherence = h1(errors).multiple_coherence
    if coherence is None or n <= m + 1 or not inside.any():
        return []
    results = []
    for p in range(len(recording.responses)):
        g = np.clip(coherence[inside, p], 0.0, 1 - 1e-12)
        tails = scipy.stats.f.logsf(g * (n - m) / ((1 - g) * m), 2 * m, 2 * (n - m))
        # neighbouring lines of a Hann window are correlated: a line and a half count as one
        statistic, lines = -2 * float(tails.sum()) / 1.5, len(g) / 1.5
        power = np.real(errors.output_spectra[inside, p, p])
        total = float(np.real(measured.output_spectra[inside, p, p]).sum())
        following = float((power * np.clip((g - m / n) / (1 - m / n), 0.0, 1.0)).sum())
        share = float(np.sqrt(following / total)) if total > 0 else 0.0
        results.append(Misfit(share, float(scipy.stats.chi2.sf(statistic, 2 * lines))))
    return results


def check_prediction(recording: BandRecording, predicted: Real, band: Band) -> list[str]:
    """Return warnings about responses that a model predicts wrongly beyond their noise.

    Parameters
    ----------
    recording
        Forces and measured responses after the run-in.
    predicted : (n_samples, n_responses)
        Responses of the model to the same forces, in the measured quantities and units.
    band : Hz
        Band of the model.
    """
    wrong = [
        (channel.name, misfit.share)
        for channel, misfit in zip(recording.responses, misfits(recording, predicted, band), strict=False)
        if misfit.p_value < GATE.p_value and misfit.share > GATE.misfit_max
    ]
    if not wrong:
        return []
    listed = ", ".join(f"{name} {100 * share:.0f} %" for name, share in wrong)
    return [
        f"the model does not describe this recording: errors that follow the forces, and are no noise, are {listed} of "
        f"the response in {band[0]:g} to {band[1]:g} Hz{_explanation(recording, predicted, band)}; check pose, tool, "
        "channels and units, or run 'millfrf diagnose'"
    ]


def _explanation(recording: BandRecording, predicted: Real, band: Band) -> str:
    """Return the factor and the delay of all predictions that explain most of the error, if they do."""
    n = len(predicted)
    window, frequencies = np.hanning(n)[:, None], np.fft.rfftfreq(n, 1 / recording.rate)
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    measured, model = (
        np.fft.rfft(window * (samples - samples.mean(axis=0)), axis=0)[inside]
        for samples in (recording.response, predicted)
    )
    product = np.sum(measured * model.conj(), axis=1)
    delays = np.arange(-GATE.longest_delay, GATE.longest_delay, 0.02 / band[1])
    correlation = np.real(np.exp(2j * np.pi * np.outer(delays, frequencies[inside])) @ product)
    best = int(np.argmax(np.abs(correlation)))
    sizes = float(np.sum(np.abs(measured) ** 2) * np.sum(np.abs(model) ** 2))
    if sizes <= 0 or correlation[best] ** 2 < (1 - GATE.misfit_max**2) * sizes:
        return ""
    factor = float(correlation[best] / np.sum(np.abs(model) ** 2))
    return f" (measured is {factor:.3g} times predicted, {1e3 * delays[best]:.1f} ms later)"


def check_fit_of_recordings(model: ModalModel, recordings: Sequence[BandRecording]) -> list[str]:
    """Return warnings about recordings that a model was fitted to and does not describe."""
    band = model.band
    if band is None:
        return []
    warnings = []
    for recording in recordings:
        try:
            prediction = predict(model, recording)
        except InputError as error:
            warnings.append(f"{recording.name}: {error}")
            continue
        rest = recording.part(recording.name, prediction.run_in, len(recording.force))
        texts = check_prediction(rest, prediction.response[prediction.run_in :], band)
        warnings += [f"{recording.name}: {text}" for text in texts]
    return warnings
