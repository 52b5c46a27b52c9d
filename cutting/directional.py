"""Directional coefficients of milling: how a tool deflection becomes a cutting force."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .milling_process import MillingProcess


def chip_direction(process: MillingProcess, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Chip thickness per unit tool displacement, ``(sin phi sin gamma, cos phi sin gamma, -cos gamma)``.

    Parameters
    ----------
    process
        Cutter; gamma is its edge angle.
    angles : (n,), rad
        Immersion angles phi of one tooth.

    Returns
    -------
    (n, 3)
    """
    sine, cosine = np.sin(process.edge_angle), np.cos(process.edge_angle)
    return np.column_stack([np.sin(angles) * sine, np.cos(angles) * sine, np.full(len(angles), -cosine)])


def force_direction(process: MillingProcess, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force on the tool per unit chip area and K_tc: tangential, radial and axial parts turned into X, Y, Z.

    The Z row's radial part is ``+ k_rc cos gamma``: Eq. 2 as printed has a minus there, which would push the edge
    into the chip; at gamma = 90 deg, the paper's cutter, the term vanishes (Altintas, Manufacturing Automation,
    2nd ed., section 2.8).

    Returns
    -------
    (n, 3)
    """
    gamma = process.edge_angle
    inward = process.krc * np.sin(gamma) + process.kac * np.cos(gamma)
    along = process.krc * np.cos(gamma) - process.kac * np.sin(gamma)
    x = -np.cos(angles) - inward * np.sin(angles)
    y = np.sin(angles) - inward * np.cos(angles)
    return np.column_stack([x, y, np.full(len(angles), along)])


def directional_matrix(process: MillingProcess, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Matrix alpha at spindle angles, all teeth together (Mohammadi & Ahmadi, Eq. 2-3).

    ``F = a K_tc alpha (X - X_tau)``; tooth j stands its ``tooth_angles`` ahead of ``angle`` and cuts between start and
    exit angle. Edges are straight; :func:`edge_matrices` has the helix.

    Parameters
    ----------
    process
        Cutter and engagement.
    angles : (n,), rad
        Spindle angles: the immersion of tooth 0.

    Returns
    -------
    (n, 3, 3), dimensionless
    """
    total = np.zeros((len(angles), 3, 3))
    for ahead in process.tooth_angles:
        phi = np.mod(np.asarray(angles) + ahead, 2 * np.pi)
        cutting = (phi >= process.start_angle) & (phi < process.exit_angle)
        product = force_direction(process, phi)[:, :, None] * chip_direction(process, phi)[:, None, :]
        total += cutting[:, None, None] * product
    return total


def average_directional_matrix(process: MillingProcess) -> NDArray[np.float64]:
    """Mean of alpha over a tooth period, in closed form, shape (3, 3).

    Examples
    --------
    >>> half = MillingProcess(2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 1e-4)
    >>> (average_directional_matrix(half)[:, :2].round(3)).tolist()
    [[0.117, -0.223], [0.277, -0.202], [-0.105, 0.105]]
    """
    gamma, start, stop = process.edge_angle, process.start_angle, process.exit_angle
    sine, cosine = np.sin(gamma), np.cos(gamma)
    inward = process.krc * sine + process.kac * cosine
    along = process.krc * cosine - process.kac * sine

    def between(value: float, at_start: float) -> float:
        return value - at_start

    one = stop - start
    s = between(-np.cos(stop), -np.cos(start))  # integral of sin
    c = between(np.sin(stop), np.sin(start))  # of cos
    ss = between(stop / 2 - np.sin(2 * stop) / 4, start / 2 - np.sin(2 * start) / 4)
    cc = one - ss
    sc = between(np.sin(stop) ** 2 / 2, np.sin(start) ** 2 / 2)
    matrix = np.array(
        [
            [sine * (-sc - inward * ss), sine * (-cc - inward * sc), -cosine * (-c - inward * s)],
            [sine * (ss - inward * sc), sine * (sc - inward * cc), -cosine * (s - inward * c)],
            [sine * along * s, sine * along * c, -cosine * along * one],
        ]
    )
    return np.asarray(process.teeth / (2 * np.pi) * matrix)


def directional_harmonics(process: MillingProcess, orders: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Fourier coefficients of alpha over the tooth passing, ``alpha(t) = sum_k alpha_k exp(i k N Omega t)``.

    ``alpha_k = N / (2 pi) integral over the immersion of alpha_tooth(phi) exp(-i k N phi)``, tooth 0 at +Y at t = 0;
    order 0 is :func:`average_directional_matrix` (Budak & Altintas 1998, Eq. 9).

    Parameters
    ----------
    process
        Cutter and engagement.
    orders : (n_orders,)
        Whole numbers k, negative ones too.

    Returns
    -------
    (n_orders, 3, 3), complex

    Examples
    --------
    >>> half = MillingProcess(2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 1e-4)
    >>> bool(np.allclose(directional_harmonics(half, np.array([0]))[0], average_directional_matrix(half)))
    True
    """
    orders = process.teeth * np.asarray(orders)
    return process.teeth * _tooth_harmonics(process, orders, force_direction)


def turn_harmonics(process: MillingProcess, orders: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Fourier coefficients over a turn of each tooth's alpha, ``alpha_j(t) = sum_k alpha_jk exp(i k Omega t)``.

    For unequal pitch: tooth j stands ``tooth_angles[j]`` ahead, which turns its coefficients.

    Returns
    -------
    (teeth, n_orders, 3, 3), complex
    """
    ahead = np.exp(1j * np.outer(process.tooth_angles, orders))
    return np.asarray(ahead[:, :, None, None] * _tooth_harmonics(process, np.asarray(orders), force_direction))


def damping_harmonics(process: MillingProcess, orders: NDArray[np.int64]) -> NDArray[np.complex128]:
    """Fourier coefficients over a turn of the normals ``sum_j n n^T`` of process damping, (n_orders, 3, 3)."""
    ahead = np.exp(1j * np.outer(process.tooth_angles, orders)).sum(axis=0)
    return np.asarray(ahead[:, None, None] * _tooth_harmonics(process, np.asarray(orders), chip_direction))


def _tooth_harmonics(
    process: MillingProcess,
    orders: NDArray[np.int64],
    acts: Callable[[MillingProcess, NDArray[np.float64]], NDArray[np.float64]],
) -> NDArray[np.complex128]:
    """``1 / (2 pi) int acts(phi) chip(phi)^T exp(-i k phi) dphi`` over the immersion, (n_orders, 3, 3)."""
    width = process.exit_angle - process.start_angle
    turns = (int(np.abs(orders).max(initial=0)) + 2) * width
    nodes, weights = np.polynomial.legendre.leggauss(20 + int(0.6 * turns))
    phi = process.start_angle + width / 2 * (nodes + 1)
    product = acts(process, phi)[:, :, None] * chip_direction(process, phi)[:, None, :]
    wave = np.exp(-1j * orders[:, None] * phi) * (weights * width / 2)
    return np.asarray(np.einsum("kn,nij->kij", wave, product) / (2 * np.pi))
