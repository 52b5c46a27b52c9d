"""Linear maps that carry the motion of a sensor in each mode to the tool tip."""

import numpy as np
from numpy.typing import NDArray

Complex = NDArray[np.complex128]


def sensor_to_tip(tip: Complex, sensor: Complex, replaced: NDArray[np.bool_]) -> Complex:
    """Give a matrix for each mode that takes its motion at the sensor to that at the tip.

    Direction by direction it is the ratio ``phi_T / phi_S``. Where the sensor hardly moves that ratio says nothing; the
    tip's motion is then ``phi_T`` of the hammer test, scaled by the whole shape: ``phi_T phi_S^H / |phi_S|^2``.

    Parameters
    ----------
    tip, sensor : (n_modes, n_directions), complex
        Shapes of the hammer test, of common scale.
    replaced : (n_modes, n_directions), bool
        Directions in which the sensor hardly moves.

    Returns
    -------
    (n_modes, n_directions, n_directions), complex

    Examples
    --------
    >>> tip, sensor = np.array([[2.0 + 0j, 3.0]]), np.array([[1.0 + 0j, 0.0]])
    >>> sensor_to_tip(tip, sensor, np.array([[False, True]]))[0].real.tolist()
    [[2.0, 0.0], [3.0, 0.0]]
    """
    safe = np.where(np.abs(sensor) > 0, sensor, 1e-300)
    own = (tip / safe)[:, :, None] * np.eye(tip.shape[1])
    whole = tip[:, :, None] * sensor.conj()[:, None, :] / np.sum(np.abs(sensor) ** 2, axis=1)[:, None, None]
    return np.asarray(np.where(replaced[:, :, None], whole, own))


def carried(maps: Complex, shapes: Complex) -> Complex:
    """Shapes (n_modes, n_directions) at the tip."""
    return np.asarray(np.einsum("rpq,rq->rp", maps, shapes))


def as_real(maps: Complex) -> NDArray[np.float64]:
    """One real matrix that carries all shapes, packed as real parts and then imaginary parts."""
    n_modes, n, _ = maps.shape
    whole = np.zeros((n_modes * n, n_modes * n), dtype=complex)
    for r, one in enumerate(maps):
        whole[r * n : (r + 1) * n, r * n : (r + 1) * n] = one
    return np.block([[whole.real, -whole.imag], [whole.imag, whole.real]])
