"""Models of a transfer brought to the form that a comparison needs: deflections, and no delay of the chain."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from estimation import DERIVATIVE_ORDERS, BandRecording, family_of, quantities_of_unit
from foundation import SI_UNITS
from modal_fit import ModalModel, Residuals

LINES = 200
"""Frequencies at which what lies outside the band is matched."""


def in_deflections(model: ModalModel) -> ModalModel:
    """A model of velocities or accelerations as one of deflections, ``H(s) / s^n``.

    Residues are divided by ``pole^n``. What is left in the model's band (its own residual terms, and what the division
    leaves at 0 Hz) is matched there by ``upper + lower / s^2``. A model of deflections is returned as it is.

    Parameters
    ----------
    model
        Modal model; its unit says what it gives.

    Raises
    ------
    InputError
        A unit that does not say what drives the rig and what answers.
    """
    response, excitation = quantities_of_unit(model.unit)
    order = DERIVATIVE_ORDERS.get(response, 0)
    if order == 0:
        return model
    natural = model.natural_frequencies
    low, high = model.band or (0.5 * float(natural.min()), 1.5 * float(natural.max()))
    s = np.asarray(2j * np.pi * np.linspace(max(low, 0.02 * high), high, LINES), dtype=complex)
    plain = replace(model, delay=0.0, physics=(), covariance=None)
    unit = f"{SI_UNITS[family_of(response)[0]]}/{SI_UNITS[excitation]}"
    bare = replace(plain, right=model.right / model.poles[:, None] ** order, residuals=None, unit=unit, errors=None)
    rest = (plain.at(s) / s[:, None, None] ** order - bare.at(s)).reshape(LINES, -1)
    basis = np.column_stack([np.ones(LINES), (1 / s**2).real])
    upper, lower = np.linalg.lstsq(basis, rest.real, rcond=None)[0].reshape(2, *plain.at(s[:1]).shape[1:])
    return replace(bare, residuals=Residuals(upper, lower), delay=model.delay, physics=model.physics)


def without_delay(
    model: ModalModel, recordings: Sequence[BandRecording]
) -> tuple[ModalModel, tuple[BandRecording, ...]]:
    """A model without the delay of its chain, and recordings whose excitations are as much later.

    Parameters
    ----------
    model
        Modal model of a transfer with or without a delay.
    recordings
        Recordings that it is compared with.
    """
    if not model.delay:
        return model, tuple(recordings)
    return replace(model, delay=0.0), tuple(_later(one, model.delay) for one in recordings)


def _later(recording: BandRecording, delay: float) -> BandRecording:
    """A recording whose excitations come later, s; what would come in from before its beginning is nothing."""
    n = len(recording.force)
    padded = next_fast_len(n + int(2 * delay * recording.rate) + 64, real=True)
    turn = np.exp(-2j * np.pi * rfftfreq(padded, 1 / recording.rate) * delay)[:, None]
    mean = recording.force.mean(axis=0)
    late = irfft(rfft(recording.force - mean, n=padded, axis=0) * turn, n=padded, axis=0)[:n]
    return replace(recording, force=np.asarray(late + mean))
