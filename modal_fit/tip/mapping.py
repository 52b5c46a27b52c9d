"""Motion of modes at the sensor mapped to their motion at the tip, with the errors of the map."""

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, Index, Real

from ..models.modal_model import ModalModel
from ..models.synthesis import derived_covariance
from ..settings import SETTINGS


def sensor_to_tip(tip: Complex, sensor: Complex, replaced: NDArray[np.bool_]) -> Complex:
    """Return one matrix for each mode that maps its motion at the sensor to its motion at the tip.

    The shape is (n_modes, n_directions, n_directions).

    The matrix is diagonal; the entry of each direction is the ratio ``phi_T / phi_S``. Where the sensor hardly moves
    (``replaced``), the ratio is all noise; the motion of the tip is then ``phi_T`` of the hammer test, scaled by the
    whole shape: ``phi_T phi_S^H / |phi_S|^2``. ``tip`` and ``sensor`` (n_modes, n_directions) are shapes of the hammer
    test, of common scale.

    >>> tip, sensor = np.array([[2.0 + 0j, 3.0]]), np.array([[1.0 + 0j, 0.0]])
    >>> sensor_to_tip(tip, sensor, np.array([[False, True]]))[0].real.tolist()
    [[2.0, 0.0], [3.0, 0.0]]
    """
    safe = np.where(np.abs(sensor) > 0, sensor, 1e-300)
    ratio = (tip / safe)[:, :, None] * np.eye(tip.shape[1])
    whole_shape = tip[:, :, None] * sensor.conj()[:, None, :] / np.sum(np.abs(sensor) ** 2, axis=1)[:, None, None]
    return np.asarray(np.where(replaced[:, :, None], whole_shape, ratio))


def shapes_at_tip(maps: Complex, shapes: Complex) -> Complex:
    """Map shapes (n_modes, n_directions) at the sensor to the tip."""
    return np.asarray(np.einsum("rpq,rq->rp", maps, shapes))


def real_matrix(maps: Complex) -> Real:
    """Return one real matrix that maps all shapes, each packed as its real parts and then its imaginary parts."""
    blocks = scipy.linalg.block_diag(*maps)
    return np.block([[blocks.real, -blocks.imag], [blocks.imag, blocks.real]])


def real_parts(values: Complex) -> Real:
    """Pack complex values as all their real parts and then all their imaginary parts."""
    return np.concatenate([values.real.ravel(), values.imag.ravel()])


def tip_maps(hammer: ModalModel, chosen: Index, replaced: NDArray[np.bool_]) -> Complex:
    """Return the maps of the ``chosen`` hammer modes, whose first rows are those of the tip."""
    n = replaced.shape[1]
    return sensor_to_tip(hammer.right[chosen, :n], hammer.right[chosen, n:], replaced)


def barely_moving(model: ModalModel, hammer: ModalModel, chosen: Index, n: int) -> NDArray[np.bool_]:
    """Return in which sensor directions a mode hardly moves: the relative error of the component is above 30 %.

    The error is that of both tests, with what their components differ by.
    """
    shapes = hammer.right[chosen, n:]
    unit = shapes / np.linalg.norm(shapes, axis=1, keepdims=True)

    def normalised(own: Complex) -> Complex:
        return np.asarray(own / np.sum(unit.conj() * own, axis=1)[:, None])

    squared = np.abs(normalised(model.right) - unit) ** 2
    by_cut = derived_covariance(model, lambda m: real_parts(normalised(m.right)))
    by_hammer = derived_covariance(hammer, lambda m: real_parts(normalised(m.right[chosen, n:])))
    for covariance in (by_cut, by_hammer):
        if covariance is not None:
            squared = squared + np.diag(covariance).reshape(2, *shapes.shape).sum(axis=0)
    return np.asarray(np.sqrt(squared / 2) > SETTINGS.uncertain_ratio * np.abs(unit))


def ratio_errors(hammer: ModalModel, chosen: Index, replaced: NDArray[np.bool_]) -> Real:
    """Return the standard errors of phi_T / phi_S; NaN where the ratio was not used or its error is not known."""
    n = replaced.shape[1]
    covariance = derived_covariance(hammer, lambda m: real_parts(m.right[chosen, :n] / m.right[chosen, n:]))
    if covariance is None:
        return np.full(replaced.shape, np.nan)
    variance = np.diag(covariance).reshape(2, *replaced.shape)
    return np.where(replaced, np.nan, np.sqrt(variance.sum(axis=0) / 2))
