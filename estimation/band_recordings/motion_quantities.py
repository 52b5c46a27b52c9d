"""Displacement, velocity and acceleration in each other, and what a sensor's known high-pass does to them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from acquisition import Channel

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

DERIVATIVE_ORDERS = {"displacement": 0, "velocity": 1, "acceleration": 2, "angle": 0, "angular_velocity": 1}
"""Times that a displacement or an angle is differentiated to give the quantity."""


def derivative_orders(channels: Sequence[Channel]) -> NDArray[np.int64]:
    """Derivative order of each channel, (n_channels,); 0 for a quantity that is no motion."""
    return np.array([DERIVATIVE_ORDERS.get(channel.quantity, 0) for channel in channels], dtype=np.int64)


def high_pass_corners(channels: Sequence[Channel]) -> tuple[float, ...]:
    """Corner of each channel's known first-order high-pass, Hz; 0 where none is known."""
    return tuple(channel.high_pass_hz or 0.0 for channel in channels)


def kinematic_factor(frequencies: Real, orders: NDArray[np.int64], corners: Sequence[float]) -> Complex:
    """Factor from displacement to what is measured, ``(i w)^order  i w / (i w + w_corner)``.

    Parameters
    ----------
    frequencies : (n,), Hz
        Frequencies at which the factor is wanted.
    orders : (n_channels,)
        Derivative orders: 0 displacement, 1 velocity, 2 acceleration.
    corners : (n_channels,), Hz
        Corners of known first-order high-passes; 0: none.

    Returns
    -------
    (n, n_channels)

    Examples
    --------
    >>> kinematic_factor(np.array([0.5 / np.pi]), np.array([0, 1, 2]), (0.0, 0.0, 0.0)).round(9).tolist()
    [[(1+0j), 1j, (-1+0j)]]
    """
    s = 2j * np.pi * np.asarray(frequencies, dtype=float)[:, None]
    factor = np.asarray(s**orders)
    for column, corner in enumerate(corners):
        if corner > 0:
            factor[:, column] *= s[:, 0] / (s[:, 0] + 2 * np.pi * corner)
    return factor


def before_high_pass(s: Complex, corners: Sequence[float]) -> Complex:
    """Factor from what a sensor shows to what was before its first-order high-pass, ``(s + w_corner) / s``.

    Parameters
    ----------
    s : (n,), 1/s
        ``i w``, or ``i w + 1/tau`` under an exponential window. At 0 Hz the factor is 1: nothing passed there.
    corners : (n_channels,), Hz
        Corners of known first-order high-passes; 0: none.

    Returns
    -------
    (n, n_channels)
    """
    factor = np.ones((len(s), len(corners)), dtype=complex)
    for column, corner in enumerate(corners):
        if corner > 0:
            np.divide(s + 2 * np.pi * corner, s, out=factor[:, column], where=s.imag > 0)
    return factor
