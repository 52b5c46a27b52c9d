"""Checks of modal models: stable, passive at drive points, fitted well enough, and used in their band."""

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import InputError
from millfrf.core.provenance import read_provenance
from modal_fit import ModalModel

from .frfs import check_frf
from .settings import GATE

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
    return check_frf(replace(model.frf(_lines(model)), band=None), name)


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
    texts = [str(text) for text in stored] if isinstance(stored, list) else []
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
