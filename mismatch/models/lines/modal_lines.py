"""What a modal model gives at lines from 0 Hz on: receptance, and displacement under forces."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

from .modal_loops import add_outside, modal_displacement

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


def receptance_at(model: ModalModel, frequencies: Real) -> Complex:
    """Receptance (n, n_responses, n_excitations) at lines from 0 Hz on.

    A residual inertia stands for modes below the band and says nothing below it: under a third of the lowest mode it
    is left out, or the mean cutting force would carry the tool away.
    """
    if model.residuals is None or not model.residuals.lower.any():
        return model.receptance(frequencies)
    plain = replace(model, residuals=replace(model.residuals, lower=np.zeros_like(model.residuals.lower)))
    values = plain.receptance(frequencies)
    inside = frequencies >= model.natural_frequencies.min() / 3
    values[inside] -= model.residuals.lower / (2 * np.pi * frequencies[inside, None, None]) ** 2
    return values


def displacement_at(model: ModalModel, frequencies: Real, force: Complex) -> Complex:
    """``H F`` (n, n_responses) at lines from 0 Hz on, with H as in :func:`receptance_at` but never written out.

    Parameters
    ----------
    frequencies : (n,), Hz
        Frequencies of the lines, from 0 Hz on.
    force : (n, n_excitations), N
        Force spectrum at the lines.
    """
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    out = np.empty((len(s), model.right.shape[1]), dtype=complex)
    modal_displacement(s, model.poles, model.right, model.left, np.ascontiguousarray(force), out)
    _add_outside(model, s, force, out)
    return out * np.exp(-s * model.delay)[:, None] if model.delay else out


def outside_displacement(model: ModalModel, frequencies: Real, force: Complex) -> Complex:
    """The part of :func:`displacement_at` that modes outside the band make, (n, n_responses), m.

    Parameters
    ----------
    model
        Modal model, with the residual terms that stand for those modes.
    frequencies, force
        As for :func:`displacement_at`.
    """
    s = np.asarray(2j * np.pi * frequencies, dtype=complex)
    out = np.zeros((len(s), model.right.shape[1]), dtype=complex)
    _add_outside(model, s, force, out)
    return out * np.exp(-s * model.delay)[:, None] if model.delay else out


def _add_outside(model: ModalModel, s: Complex, force: Complex, out: Complex) -> None:
    """Add the residual terms' part; under a third of the lowest mode a residual inertia is left out."""
    if model.residuals is None:
        return
    own = model.residuals
    poles = np.zeros(0, dtype=complex) if own.poles is None else np.asarray(own.poles, dtype=complex)
    residues = np.zeros((0, *own.upper.shape)) if own.residues is None else own.residues
    lowest = 2 * np.pi * float(model.natural_frequencies.min()) / 3
    plain = (np.ascontiguousarray(own.upper, dtype=float), np.ascontiguousarray(own.lower, dtype=float))
    terms = (np.ascontiguousarray(poles), np.ascontiguousarray(residues, dtype=complex))
    add_outside(s, terms, plain, lowest, np.ascontiguousarray(force, dtype=complex), out)
