"""Modes of a model that become out-of-band terms."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .modal_model import ModalModel
from .out_of_band import Residuals


def outside_as_residuals(model: ModalModel, inside: NDArray[np.bool_]) -> ModalModel:
    """Move the modes for which ``inside`` (n_modes,) is false to the residuals of a model."""
    if inside.all():
        return model
    outer = ~inside
    covariance = model.covariance
    if covariance is not None:
        n_right, n_left = model.right.shape[1], model.left.shape[1]
        remaining = np.concatenate([np.repeat(inside, width) for width in (1, 1, n_right, n_right, n_left, n_left)])
        covariance = np.asarray(covariance[np.ix_(remaining, remaining)])
    none = np.zeros((len(model.responses), len(model.excitations)))
    residuals = model.residuals or Residuals(none, none)
    poles, residues = model.poles[outer], np.einsum("rp,rq->rpq", model.right[outer], model.left[outer])
    if residuals.poles is not None and residuals.residues is not None:
        poles, residues = np.concatenate([residuals.poles, poles]), np.concatenate([residuals.residues, residues])
    return replace(
        model,
        poles=model.poles[inside],
        right=model.right[inside],
        left=model.left[inside],
        residuals=replace(residuals, poles=poles, residues=residues),
        covariance=covariance,
        errors=None if model.errors is None else model.errors.ordered(np.flatnonzero(inside)),
    )
