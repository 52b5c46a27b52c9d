"""Subsets and unions of the modes of a model, with their covariance."""

from dataclasses import replace

import numpy as np

from millfrf.core import Index, Real

from ..models.modal_model import ModalModel, ModeErrors


def parameter_places(model: ModalModel, modes: Index) -> Index:
    """Return where the parameters of ``modes`` stand in the order of ``ModalModel.covariance``."""
    places, start = [], 0
    for width in (1, model.right.shape[1], model.left.shape[1]):
        for _ in ("real", "imaginary"):
            places.append((start + modes[:, None] * width + np.arange(width)).ravel())
            start += len(model.poles) * width
    return np.concatenate(places)


def chosen_modes(model: ModalModel, modes: Index) -> ModalModel:
    """Return the model with only ``modes``, in their order; everything else stays."""
    covariance = model.covariance
    if covariance is not None:
        places = parameter_places(model, modes)
        covariance = covariance[np.ix_(places, places)]
    return replace(
        model,
        poles=model.poles[modes],
        right=model.right[modes],
        left=model.left[modes],
        covariance=covariance,
        errors=None if model.errors is None else model.errors.ordered(modes),
    )


def with_modes(model: ModalModel, added: ModalModel, shared: Real | None) -> ModalModel:
    """Return the modes of both models, by rising frequency; everything else is that of the first.

    Parameters
    ----------
    model, added
        Models of the same degrees of freedom.
    shared : (n_first, n_added) or None
        Covariance of the parameters of both; None: independent.
    """
    n, total = len(model.poles), len(model.poles) + len(added.poles)
    joined = replace(
        model,
        poles=np.concatenate([model.poles, added.poles]),
        right=np.vstack([model.right, added.right]),
        left=np.vstack([model.left, added.left]),
        covariance=None,
        errors=_joined_errors(model, added),
    )
    if model.covariance is not None and added.covariance is not None:
        first, second = (parameter_places(joined, modes) for modes in (np.arange(n), np.arange(n, total)))
        covariance = np.zeros((len(first) + len(second),) * 2)
        covariance[np.ix_(first, first)] = model.covariance
        covariance[np.ix_(second, second)] = added.covariance
        if shared is not None:
            covariance[np.ix_(first, second)] = shared
            covariance[np.ix_(second, first)] = shared.T
        joined = replace(joined, covariance=covariance)
    return chosen_modes(joined, np.argsort(joined.natural_frequencies, kind="stable"))


def _joined_errors(model: ModalModel, added: ModalModel) -> ModeErrors | None:
    """Append the errors of the added modes, as noise: they are not known by other sources."""
    known = added.standard_errors()
    if model.errors is None or known is None:
        return None
    noise, unknown = np.column_stack(known), np.full((len(added.poles), 2), np.nan)
    own = model.errors
    return ModeErrors(
        np.vstack([own.noise, noise]),
        *(np.vstack([part, unknown]) for part in (own.points, own.band, own.terms)),
    )
