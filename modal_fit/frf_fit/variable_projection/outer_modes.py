"""Modes just outside the band: fitted beside those inside, told among the out-of-band terms."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models import ModalModel, Residuals
from .elimination import Modes

REACH = 1.5
"""A pole within this factor of an edge of the band may be a mode whose flank reaches into the band."""

_NO_VIBRATION = 0.5  # damping ratio


def inside(modes: Modes, band: tuple[float, float]) -> NDArray[np.bool_]:
    """Say which modes stand in the band."""
    return np.asarray((modes.frequencies > band[0]) & (modes.frequencies < band[1]))


def just_outside(pole: complex, band: tuple[float, float]) -> bool:
    """Whether a pole (rad/s) outside the band may be a mode whose flank reaches into it.

    A mode there cannot be left to the fixed out-of-band poles: a mode inside would leave its place for it.

    Examples
    --------
    >>> [just_outside(2 * np.pi * f * (-0.01 + 1j), (20.0, 40.0)) for f in (10, 18, 30, 45, 80)]
    [False, True, False, True, False]
    """
    frequency, damping = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
    low, high = band
    near = low / REACH < frequency <= low or high <= frequency < high * REACH
    return bool(near and 0 < damping < _NO_VIBRATION)


def with_outer_as_residuals(model: ModalModel) -> ModalModel:
    """Move the modes outside the band of a model to its residuals.

    Parameters
    ----------
    model
        Modal model with a band, and with covariance and errors of all modes.
    """
    assert model.band is not None
    frequencies = model.natural_frequencies
    stays = (frequencies > model.band[0]) & (frequencies < model.band[1])
    if stays.all():
        return model
    outer = ~stays
    residues = np.einsum("rp,rq->rpq", model.right[outer], model.left[outer])
    return replace(
        model,
        poles=model.poles[stays],
        right=model.right[stays],
        left=model.left[stays],
        residuals=_joined(model.residuals, model.poles[outer], residues),
        covariance=None if model.covariance is None else _part(model, stays),
        errors=None if model.errors is None else model.errors.ordered(np.flatnonzero(stays)),
    )


def _joined(residuals: Residuals | None, poles: NDArray[np.complex128], residues: NDArray[np.complex128]) -> Residuals:
    """Residuals with further poles."""
    if residuals is None:
        nothing = np.zeros(residues.shape[1:])
        return Residuals(nothing, nothing, poles, residues)
    if residuals.poles is None or residuals.residues is None:
        return replace(residuals, poles=poles, residues=residues)
    return replace(
        residuals,
        poles=np.concatenate([residuals.poles, poles]),
        residues=np.concatenate([residuals.residues, residues]),
    )


def _part(model: ModalModel, stays: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Rows and columns of the covariance that belong to the modes that stay."""
    assert model.covariance is not None
    widths = (1, 1, model.right.shape[1], model.right.shape[1], model.left.shape[1], model.left.shape[1])
    kept = np.concatenate([np.repeat(stays, width) for width in widths])
    return np.asarray(model.covariance[np.ix_(kept, kept)])
