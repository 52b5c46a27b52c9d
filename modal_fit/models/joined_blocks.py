"""One model of an FRF matrix from models of its blocks, which were measured apart."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex, Index, Real

from .modal_model import ModalModel, ModeErrors
from .out_of_band import Residuals


def joined_model(models: Sequence[ModalModel], frf: Frf) -> ModalModel:
    """Join models of the measured blocks of an FRF to one block-diagonal model, its modes in order of frequency.

    The blocks were measured apart, so that their errors are independent.
    """
    axes = [_axes(model, frf) for model in models]
    poles = np.concatenate([model.poles for model in models])
    order = np.argsort(np.abs(poles), kind="stable")
    errors = [model.errors for model in models if model.errors is not None]
    return replace(
        models[0],
        poles=poles[order],
        right=_wide([model.right for model in models], [rows for rows, _ in axes], len(frf.responses))[order],
        left=_wide([model.left for model in models], [columns for _, columns in axes], len(frf.excitations))[order],
        responses=frf.responses,
        excitations=frf.excitations,
        residuals=_joined_residuals(models, frf),
        covariance=_joined_covariance(models, frf, order),
        errors=_joined_errors(errors).ordered(order) if len(errors) == len(models) else None,
        measured=frf.measured,
    )


def placed(matrices: Sequence[NDArray[Any]], models: Sequence[ModalModel], frf: Frf) -> NDArray[Any]:
    """Place the matrix (..., n_own, n_own) of each block's model in one of the whole FRF, with zeros between them."""
    whole = np.zeros((*matrices[0].shape[:-2], len(frf.responses), len(frf.excitations)), dtype=matrices[0].dtype)
    for matrix, model in zip(matrices, models, strict=True):
        rows, columns = _axes(model, frf)
        whole[..., rows[:, None], columns] = matrix
    return whole


def _axes(model: ModalModel, frf: Frf) -> tuple[Index, Index]:
    """Return the rows and columns of a block's model in the whole FRF."""
    rows = np.array([frf.responses.index(name) for name in model.responses])
    return rows, np.array([frf.excitations.index(name) for name in model.excitations])


def _wide(vectors: Sequence[Complex], places: Sequence[Index], size: int) -> Complex:
    """Stack the vectors (n_modes, n_own) of each block, along an axis of ``size`` with zeros at the other blocks."""
    stacked = [np.zeros((len(own), size), dtype=complex) for own in vectors]
    for wide, own, place in zip(stacked, vectors, places, strict=True):
        wide[:, place] = own
    return np.concatenate(stacked)


def _joined_residuals(models: Sequence[ModalModel], frf: Frf) -> Residuals | None:
    terms = [model.residuals for model in models if model.residuals is not None]
    owners = [model for model in models if model.residuals is not None]
    if not terms:
        return None
    upper, lower = (placed([getattr(term, name) for term in terms], owners, frf) for name in ("upper", "lower"))
    outside = [
        (term.poles, placed([term.residues], [owner], frf))
        for term, owner in zip(terms, owners, strict=True)
        if term.poles is not None and term.residues is not None
    ]
    if not outside:
        return Residuals(upper, lower)
    poles, residues = (np.concatenate(parts) for parts in zip(*outside, strict=True))
    return Residuals(upper, lower, poles, residues)


def _joined_errors(errors: Sequence[ModeErrors]) -> ModeErrors:
    names = ("noise", "points", "band", "terms")
    return ModeErrors(*(np.concatenate([getattr(each, name) for each in errors]) for name in names))


def _joined_covariance(models: Sequence[ModalModel], frf: Frf, order: Index) -> Real | None:
    """Join covariances of the packed parameters; None where a model has none."""
    rank = np.argsort(order)
    joined = np.zeros(2 * [2 * len(order) * (1 + len(frf.responses) + len(frf.excitations))])
    first = 0
    for model in models:
        if model.covariance is None:
            return None
        modes = rank[first : first + len(model.poles)]
        places = np.concatenate(list(_places(model, frf, modes, len(order))))
        joined[np.ix_(places, places)] = model.covariance
        first += len(modes)
    return joined


def _places(model: ModalModel, frf: Frf, modes: Index, n_modes: int) -> Iterator[Index]:
    """Yield the places of a block's parameters among those of the joined model, in the order of the block's."""
    rows, columns = _axes(model, frf)
    pole, right, left = (np.zeros(1, int), 1), (rows, len(frf.responses)), (columns, len(frf.excitations))
    first = 0
    for own, width in (pole, pole, right, right, left, left):  # real part, then imaginary part of each
        yield (first + modes[:, None] * width + own).ravel()
        first += n_modes * width
