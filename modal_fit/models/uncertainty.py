"""One mechanism carries covariance to whatever is derived from a modal model."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .modal_model import ModalModel

Real = NDArray[np.float64]


def pack_parameters(model: ModalModel) -> Real:
    """Poles, right and left vectors as one real vector, in the order of ``ModalModel.covariance``."""
    pieces = []
    for array in (model.poles, model.right, model.left):
        pieces += [array.real.ravel(), array.imag.ravel()]
    return np.concatenate(pieces)


def unpack_parameters(model: ModalModel, packed: Real) -> ModalModel:
    """The model with the parameters of ``packed``."""
    changes: dict[str, Any] = {}
    start = 0
    for name in ("poles", "right", "left"):
        shape = getattr(model, name).shape
        size = int(np.prod(shape))
        changes[name] = (packed[start : start + size] + 1j * packed[start + size : start + 2 * size]).reshape(shape)
        start += 2 * size
    return replace(model, **changes)


def derived_covariance(model: ModalModel, derived: Callable[[ModalModel], Real]) -> Real | None:
    """Compute the covariance of any real vector derived from the model, ``J C J^T`` with J by central differences.

    Parameters
    ----------
    model
        Modal model with a covariance; without one the result is None.
    derived
        Function that takes a model and gives a real vector (n,).

    Returns
    -------
    (n, n) or None
    """
    if model.covariance is None:
        return None
    centre = pack_parameters(model)
    spread = np.sqrt(np.maximum(np.diag(model.covariance), 0.0))
    columns = []
    for k in range(len(centre)):
        step = np.zeros_like(centre)
        step[k] = max(0.1 * spread[k], 1e-9 * abs(centre[k]), 1e-30)
        upper, lower = (derived(unpack_parameters(model, centre + sign * step)) for sign in (1, -1))
        columns.append((upper - lower) / (2 * step[k]))
    jacobian = np.column_stack(columns)
    return np.asarray(jacobian @ model.covariance @ jacobian.T)


def frequency_and_damping_errors(model: ModalModel) -> tuple[Real, Real] | None:
    """Standard errors of natural frequencies (Hz) and damping ratios, each (n_modes,); None where none is known.

    A model's :class:`ModeErrors` are taken where it has them, else its covariance, which holds the noise alone.
    """
    return model.standard_errors()
