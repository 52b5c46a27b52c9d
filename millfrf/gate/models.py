"""Checks of modal models: stable, passive, fitted well enough, used in their band, in agreement with recordings."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import BandRecording, Frf, h1, spectra_for_judging
from millfrf.core import Band, InputError, Real
from millfrf.core.provenance import edits_of, read_provenance
from millfrf.mismatch import predict
from modal_fit import ModalModel

from .frfs import check_frf, nodes_with_returned_power
from .settings import GATE

DRIFT = "pose_drift"  # law of a joint whose stiffness changes during a recording

SAME_LENGTH = 0.05  # share by which recordings of one length may differ

NOISE = "what the noise explains"  # phrase of the warning about the misfit; with it, a fit gets no second warning


def check_model(model: ModalModel, name: str = "the model") -> list[str]:
    """Check a modal model before it is used for lobes, a calibration, a prediction or a diagnosis.

    Parameters
    ----------
    model
        Fitted, imported or written by hand.
    name
        Name of its file, for the message.

    Returns
    -------
    list of str
        Warnings: drive points that return part of the power in the model's band.

    Raises
    ------
    InputError
        No mode, none inside the model's band, an unstable pole, vectors that are all zero, or a drive point that moves
        against its own force.
    """
    if not len(model.poles):
        raise InputError(f"{name} has no mode; fit it in a band that holds one")
    zeta = model.damping_ratios
    if zeta.min() <= 0:
        worst = int(zeta.argmin())
        raise InputError(
            f"{name}: mode {worst + 1} at {model.natural_frequencies[worst]:.4g} Hz has a damping ratio of "
            f"{100 * zeta[worst]:.3g} %: it is unstable by itself; fit again, or turn the sign of the pole's real part"
        )
    _check_band(model, name)
    return check_frf(_evaluated(model), name)


def returned_power_sentences(structure: ModalModel | Frf) -> list[str]:
    """Return a sentence on each node of a structure that gives back power, which no passive structure does."""
    return nodes_with_returned_power(_evaluated(structure) if isinstance(structure, ModalModel) else structure)


def _evaluated(model: ModalModel) -> Frf:
    return replace(model.frf(_lines(model)), band=None)


def terms_left_out(model: ModalModel, name: str = "the model") -> list[str]:
    """Return a warning if a diagnosis added physical terms to a model of which only the modes are used.

    Parameters
    ----------
    model
        Model of lobes or of a calibration.
    name
        Name of its file, for the message.
    """
    if not model.physics:
        return []
    terms = ", ".join(dict.fromkeys(str(term.get("name")) for term in model.physics))
    return [
        f"{name} holds terms of a diagnosis ({terms}), which only millfrf predict uses: this command uses its modes "
        "only; for lobes with the terms see the report of millfrf diagnose --cutting"
    ]


def _check_band(model: ModalModel, name: str) -> None:
    """Refuse a band that contains no mode of the model, because the unit of the band is probably wrong."""
    natural = model.natural_frequencies
    if model.band is not None and not ((natural >= 0.8 * model.band[0]) & (natural <= 1.25 * model.band[1])).any():
        raise InputError(
            f"{name}: its band of {model.band[0]:g} to {model.band[1]:g} Hz holds none of its modes "
            f"({natural.min():.4g} to {natural.max():.4g} Hz); correct band_hz, or fit again"
        )


def stored_warnings(path: str | os.PathLike[str]) -> list[str]:
    """Return the warnings stored in an FRF's or a model's file, each with the file's name.

    They are the warnings in the provenance of the file and warnings about a poor fit. Every result that uses the file
    repeats them.
    """
    provenance = read_provenance(path)
    stored = provenance.get("warnings", [])
    texts = [edits] if (edits := edits_of(path)) else []
    texts += [str(text) for text in stored] if isinstance(stored, list) else []
    if provenance.get("step") == "fit":
        error = provenance.get("relative_error")
        texts += fit_warnings(provenance.get("reduced_chi_square"), None if error is None else np.asarray(error), texts)
    return [f"{Path(path).name}: {text}" for text in dict.fromkeys(texts)]


def fit_warnings(
    chi_square: float | None, error: NDArray[np.float64] | None, own_warnings: Sequence[str] = ()
) -> list[str]:
    """Return warnings about the quality of a fit, one sentence each.

    Parameters
    ----------
    chi_square
        Reduced chi-square, misfit over noise; None or NaN: not known.
    error : (n_responses, n_excitations) or None
        Root mean square misfit over root mean square FRF.
    own_warnings
        Warnings of the fit itself, which are not repeated.
    """
    warnings = []
    if chi_square is not None and chi_square > GATE.chi_square_max and not any(NOISE in text for text in own_warnings):
        warnings.append(f"the misfit is {chi_square:.1f} times {NOISE}: its error bars are too small")
    if chi_square is not None and chi_square < 1 / GATE.chi_square_max:
        warnings.append(
            f"the misfit is {chi_square:.2g} times {NOISE}: the noise is stated too large, or the model has more modes "
            "than the data show"
        )
    if error is not None and error.max() > GATE.misfit_max and not any("% only" in text for text in own_warnings):
        warnings.append(f"an entry of the FRF is fitted to {100 * error.max():.0f} % only")
    return warnings


def smearing_warnings(model: ModalModel, frf: Frf) -> list[str]:
    """Return a warning if the window of an FRF's segments increases damping ratios by more than their error bars.

    Each line of an averaged spectrum mixes its neighbours over the width s of the window. A resonance
    ``1 / (i (f - f_n) + b)`` of half width ``b = zeta f_n`` becomes ``1 / x - s^2 / x^3``, as if b were ``b + s^2 / b``
    (least squares over all lines; less where lines at the peak are noisier): damping ratios are too large by up to
    about ``(s / b)^2`` (Bendat & Piersol, Random Data, 4th ed., section 8.5).

    Parameters
    ----------
    model
        Modes that were fitted to the FRF.
    frf
        Fitted FRF; there is no warning if its spectral width is not known.
    """
    errors = model.standard_errors()
    if frf.spectral_width is None or errors is None:
        return []
    fitted = np.abs(model.poles.real) / (2 * np.pi)
    # solve fitted = b + s^2 / b for b; where s is too large for a solution, take the closest value
    half_width = (fitted + np.sqrt(np.maximum(fitted**2 - 4 * frf.spectral_width**2, 0.0))) / 2
    excess = fitted / half_width - 1
    beyond = excess * model.damping_ratios > errors[1]
    if not beyond.any():
        return []
    worst = int(np.argmax(np.where(beyond, excess, 0.0)))
    return [
        f"the window of the FRF's segments widens resonances: {int(beyond.sum())} of {len(excess)} damping ratios are "
        f"too large by up to about {100 * excess[worst]:.2g} % of themselves (most at "
        f"{model.natural_frequencies[worst]:.4g} Hz), and their error bars do not include it; fit the recordings "
        "themselves, or estimate with longer segments"
    ]


def _lines(model: ModalModel) -> NDArray[np.float64]:
    """Return the lines (Hz) for the check: over the model's band or the range of its modes, and denser at each peak."""
    natural, width = model.natural_frequencies, 2 * np.abs(model.poles.real) / (2 * np.pi)
    low, high = model.band or (0.5 * float(natural.min()), 1.5 * float(natural.max()))
    near = natural[:, None] + width[:, None] * np.linspace(-2, 2, 17)
    lines = np.concatenate([np.linspace(low, high, GATE.model_lines), near.ravel()])
    return np.unique(lines[(lines >= max(low, 1e-6)) & (lines <= high)])


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
        # neighbouring lines of a Hann window are correlated: 1.5 lines hold the information of one
        statistic, lines = -2 * float(tails.sum()) / 1.5, len(g) / 1.5
        power = np.real(errors.output_spectra[inside, p, p])
        total = float(np.real(measured.output_spectra[inside, p, p]).sum())
        following = float((power * np.clip((g - m / n) / (1 - m / n), 0.0, 1.0)).sum())
        share = float(np.sqrt(following / total)) if total > 0 else 0.0
        results.append(Misfit(share, float(scipy.stats.chi2.sf(statistic, 2 * lines))))
    return results


def check_preloads(model: ModalModel, recording: str) -> list[str]:
    """Return warnings about joints whose force was fitted to each of other recordings on its own.

    Parameters
    ----------
    model
        Model with the terms of a diagnosis.
    recording
        Name of the recording that is predicted.
    """
    factors = [(term["name"], term["location"].get("preloads", {})) for term in model.physics]
    return [
        f"{name} had another force in each recording of the diagnosis, {min(own.values()):.3g} to "
        f"{max(own.values()):.3g} times that in {next(iter(own))}; {recording} is none of them, and "
        "predicted with their mean: diagnose it too"
        for name, own in factors
        if own and recording not in own
    ]


def check_drifts(model: ModalModel, recording: BandRecording) -> list[str]:
    """Return warnings about joints that drift in recordings of another length than that of a prediction.

    Parameters
    ----------
    model
        Model with the terms of a diagnosis.
    recording
        Recording that is predicted.
    """
    warnings = []
    for term in model.physics:
        lengths = term["location"].get("motion", {}).get("durations") if term["name"] == DRIFT else None
        if lengths is None or (1 - SAME_LENGTH) * lengths[0] <= recording.duration <= (1 + SAME_LENGTH) * lengths[1]:
            continue
        usual = f"{lengths[0]:.3g}" + (f" to {lengths[1]:.3g}" if lengths[1] > (1 + SAME_LENGTH) * lengths[0] else "")
        warnings.append(
            f"{DRIFT} counts in shares of a recording, and was fitted to {usual} s; {recording.name} lasts "
            f"{recording.duration:.3g} s, and the whole change is applied to it: predict recordings of the same length"
        )
    return warnings


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
