"""Modal models that a job uses: stable, passive at drive points, fitted well enough, and used in their band."""

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

CHI_SQUARE = 2.0
"""Misfit over noise of a fit above which its error bars are too small; below the inverse the noise is overstated."""

MISFIT = 0.3
"""Root mean square misfit over an FRF entry's own, above which the entry is hardly known."""

NOISE = "what the noise explains"

N_LINES = 400


def check_model(model: ModalModel, name: str = "the model") -> list[str]:
    """Judge a modal model before lobes, a calibration, a prediction or a diagnosis stand on it.

    Parameters
    ----------
    model
        Fitted, imported or written by hand.
    name
        Name of its file, for the message.

    Returns
    -------
    list of str
        Doubts: drive points that give back part of the power in the model's band.

    Raises
    ------
    InputError
        No mode, none inside the model's band, an unstable pole,
        vectors that are all zero, or a drive point that moves against its own force.
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
    """Say that a job counts the modes of a model alone, where a diagnosis has added terms of physics to them.

    Parameters
    ----------
    model
        Model that a job of modes takes: lobes, a calibration.
    name
        Name of its file, for the message.

    Returns
    -------
    list of str
        One doubt, or none where the model has no terms.
    """
    if not model.physics:
        return []
    terms = ", ".join(dict.fromkeys(str(term.get("name")) for term in model.physics))
    return [
        f"{name} holds terms of a diagnosis ({terms}), which only millfrf predict counts: here its modes count alone; "
        "for lobes with the terms see the report of millfrf diagnose --cutting"
    ]


def _check_band(model: ModalModel, name: str) -> None:
    """Refuse a band that holds none of the modes, as a wrong unit makes it."""
    natural = model.natural_frequencies
    if model.band is not None and not ((natural >= 0.8 * model.band[0]) & (natural <= 1.25 * model.band[1])).any():
        raise InputError(
            f"{name}: its band of {model.band[0]:g} to {model.band[1]:g} Hz holds none of its modes "
            f"({natural.min():.4g} to {natural.max():.4g} Hz); correct band_hz, or fit again"
        )


def stored_doubts(path: str | os.PathLike[str]) -> list[str]:
    """Give the doubts stored in an FRF's or a model's file, each with the file's name.

    The warnings in its provenance, and a fit that was poor: they go wherever the result goes.
    """
    made = read_provenance(path)
    stored = made.get("warnings", [])
    texts = [str(text) for text in stored] if isinstance(stored, list) else []
    if made.get("step") == "fit":
        error = made.get("relative_error")
        texts += fit_doubts(made.get("reduced_chi_square"), None if error is None else np.asarray(error), texts)
    return [f"{Path(path).name}: {text}" for text in dict.fromkeys(texts)]


def fit_doubts(chi_square: float | None, error: NDArray[np.float64] | None, said: Sequence[str] = ()) -> list[str]:
    """Give the doubts that the quality of a fit raises, one sentence each.

    Parameters
    ----------
    chi_square
        Misfit over noise, reduced; None or NaN: not known.
    error : (n_responses, n_excitations) or None
        Root mean square misfit over root mean square FRF.
    said
        Warnings that the fit gave itself; what they say is not said twice.
    """
    doubts = []
    if chi_square is not None and chi_square > CHI_SQUARE and not any(NOISE in text for text in said):
        doubts.append(f"the misfit is {chi_square:.1f} times {NOISE}: its error bars are too small")
    if chi_square is not None and chi_square < 1 / CHI_SQUARE:
        doubts.append(
            f"the misfit is {chi_square:.2g} times {NOISE}: the noise is stated too large, or the model has more modes "
            "than the data show"
        )
    if error is not None and error.max() > MISFIT and not any("% only" in text for text in said):
        doubts.append(f"an entry of the FRF is fitted to {100 * error.max():.0f} % only")
    return doubts


def smearing_doubts(model: ModalModel, frf: Frf) -> list[str]:
    """Doubt damping ratios that the window of an FRF's segments makes too large by more than their stated error.

    Each line of an averaged spectrum mixes its neighbours over the width s of the window. A resonance
    ``1 / (i (f - f_n) + b)`` of half width ``b = zeta f_n`` becomes ``1 / x - s^2 / x^3``, as if b were ``b + s^2 / b``
    (least squares over all lines; less where lines at the peak are noisier): damping ratios are too large by up to
    about ``(s / b)^2`` (Bendat & Piersol, Random Data, 4th ed., section 8.5).

    Parameters
    ----------
    model
        Modes that were fitted to the FRF.
    frf
        The FRF; without a known width nothing is said.
    """
    errors = model.standard_errors()
    if frf.spectral_width is None or errors is None:
        return []
    seen = np.abs(model.poles.real) / (2 * np.pi)
    half_width = (seen + np.sqrt(np.maximum(seen**2 - 4 * frf.spectral_width**2, 0.0))) / 2
    excess = seen / half_width - 1
    beyond = excess * model.damping_ratios > errors[1]
    if not beyond.any():
        return []
    worst = int(np.argmax(np.where(beyond, excess, 0.0)))
    return [
        f"the window of the FRF's segments widens resonances: {int(beyond.sum())} of {len(excess)} damping ratios are "
        f"too large by up to about {100 * excess[worst]:.2g} % of themselves (most at "
        f"{model.natural_frequencies[worst]:.4g} Hz), and their error bars do not hold it; fit the recordings "
        "themselves, or estimate with longer segments"
    ]


def _lines(model: ModalModel) -> NDArray[np.float64]:
    """Lines (Hz) on which the model is judged: its band, or around its modes; each mode's peak is among them."""
    natural, width = model.natural_frequencies, 2 * np.abs(model.poles.real) / (2 * np.pi)
    low, high = model.band or (0.5 * float(natural.min()), 1.5 * float(natural.max()))
    near = natural[:, None] + width[:, None] * np.linspace(-2, 2, 17)
    every = np.concatenate([np.linspace(low, high, N_LINES), near.ravel()])
    return np.unique(every[(every >= max(low, 1e-6)) & (every <= high)])
