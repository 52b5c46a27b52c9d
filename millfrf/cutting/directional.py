"""Directional coefficients of milling: the cutting force that a deflection of the tool causes."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, Real

from .process import MillingProcess, refuse_varied
from .tooth import tooth_force


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


def edge_matrices(process: MillingProcess, angles: Real, depth: float) -> Real:
    """Matrix alpha of each tooth, averaged over the depth of a helical edge.

    ``alpha_j = (1 / a) int_0^a alpha(phi_j - 2 z tan(beta) / D) dz`` over the part of the edge that is in the cut
    (Altintas, Manufacturing Automation, 2nd ed., section 2.8.1); the force is ``a K_tc sum_j alpha_j (X - X_j)`` with
    X_j the tool's place when the tooth before stood at the same angle.

    Parameters
    ----------
    process
        Cutter and engagement.
    angles : (n,), rad
        Spindle angles: the immersion of tooth 0 at its tip.
    depth : m
        Axial depth of cut a; it has no effect with straight edges.

    Returns
    -------
    (teeth, n, 3, 3), dimensionless
    """
    moments = _edge_moments(process, angles, depth)
    force, chip = _force_rows(process), _chip_rows(process)
    return np.asarray(np.einsum("ip,tnpq,jq->tnij", force, moments, chip))


def damping_matrices(process: MillingProcess, angles: Real, depth: float) -> Real:
    """Sum over teeth of ``n n^T`` along the engaged edges, n the normal of the surface, shape (n, 3, 3).

    The force of process damping is ``-a (C / V) P X'`` with V the cutting speed (Tyler & Schmitz 2013, Eq. 1, for an
    edge whose normal turns with it).
    """
    chip = _chip_rows(process)
    return np.asarray(np.einsum("ip,tnpq,jq->nij", chip, _edge_moments(process, angles, depth), chip))


def _force_rows(process: MillingProcess) -> Real:
    """Rows M with force direction ``M (sin phi, cos phi, 1)``."""
    gamma = process.edge_angle
    inward = process.krc * np.sin(gamma) + process.kac * np.cos(gamma)
    along = process.krc * np.cos(gamma) - process.kac * np.sin(gamma)
    return np.array([[-inward, -1.0, 0.0], [1.0, -inward, 0.0], [0.0, 0.0, along]])


def _chip_rows(process: MillingProcess) -> Real:
    sine, cosine = np.sin(process.edge_angle), np.cos(process.edge_angle)
    return np.array([[sine, 0.0, 0.0], [0.0, sine, 0.0], [0.0, 0.0, -cosine]])


def _edge_moments(process: MillingProcess, angles: Real, depth: float) -> Real:
    """Mean over the edge of ``b b^T`` with ``b = (sin phi, cos phi, 1)`` where it cuts, (teeth, n, 3, 3)."""
    tips = np.asarray(angles)[None, :] + np.array(process.tooth_angles)[:, None]
    lag = process.lag(depth)
    if lag < 1e-9:
        phi = np.mod(tips, 2 * np.pi)
        cutting = (phi >= process.start_angle) & (phi < process.exit_angle)
        b = np.stack([np.sin(phi), np.cos(phi), np.ones_like(phi)], axis=-1)
        return np.asarray(cutting[..., None, None] * b[..., :, None] * b[..., None, :])
    tips = np.mod(tips, 2 * np.pi)
    total = np.zeros((*tips.shape, 3, 3))
    for turn in range(int(np.floor(lag / (2 * np.pi))) + 2):
        high = np.clip(tips + 2 * np.pi * turn, process.start_angle, process.exit_angle)
        low = np.clip(tips + 2 * np.pi * turn - lag, process.start_angle, process.exit_angle)
        total += _moment_integral(high) - _moment_integral(low)
    return np.asarray(total / lag)


def _moment_integral(phi: Real) -> Real:
    """Antiderivative of ``b b^T``, (..., 3, 3)."""
    sine, cosine = np.sin(phi), np.cos(phi)
    ss, cc, sc = phi / 2 - sine * cosine / 2, phi / 2 + sine * cosine / 2, sine**2 / 2
    rows = [[ss, sc, -cosine], [sc, cc, sine], [-cosine, sine, phi]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


_NODES = 200  # of the quadrature over the immersion; the integrand is a few waves of smooth function


def force_harmonics(process: MillingProcess, n_harmonics: int) -> NDArray[np.complex128]:
    """Coefficients c_h of the stable cutting force, for 1 m of depth: ``F(t) = c_0 + sum_h 2 Re(c_h exp(i h N W t))``.

    ``c_h = N / (2 pi) int f(phi) exp(-i h N phi) dphi`` over the immersion, f the force of one tooth with chip
    thickness ``feed sin(phi) sin(gamma)`` and edge forces (Altintas, Manufacturing Automation, 2nd ed., section 2.7).
    Runout, which puts lines between these, is left out.

    Parameters
    ----------
    process
        Cutter, immersion, coefficients, feed.
    n_harmonics
        Highest harmonic h of the tooth-passing frequency.

    Returns
    -------
    (n_harmonics + 1, 3), N/m, in X, Y, Z

    Raises
    ------
    InputError
        A negative number of harmonics, helical edges or unequal pitch.

    Examples
    --------
    >>> slot = MillingProcess(4, 0.01, math.pi / 2, 1e9, 0.3, 0.0, 0.0, math.pi, 1e-4)
    >>> np.round(force_harmonics(slot, 0)[0].real / 1e5, 3)  # 4 teeth: N feed ktc / 4 (krc, 1)
    array([-0.3,  1. ,  0. ])
    """
    if n_harmonics < 0:
        raise InputError(f"{n_harmonics} harmonics: give 0 or more")
    refuse_varied(process, "the plan of excitation", "give straight edges at equal pitch", takes=("damping",))
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    half = 0.5 * (process.exit_angle - process.start_angle)
    angles = process.start_angle + half * (nodes + 1)
    force = np.array([_force_of_tooth(process, float(angle)) for angle in angles])
    waves = np.exp(-1j * process.teeth * np.outer(np.arange(n_harmonics + 1), angles))
    return np.asarray(process.teeth / (2 * math.pi) * half * (waves * weights) @ force)


def _force_of_tooth(process: MillingProcess, angle: float) -> tuple[float, float, float]:
    sine_edge, cosine_edge = math.sin(process.edge_angle), math.cos(process.edge_angle)
    chip = process.feed_per_tooth * math.sin(angle) * sine_edge
    tangential = process.ktc * chip
    return tooth_force(
        math.sin(angle),
        math.cos(angle),
        sine_edge,
        cosine_edge,
        tangential + process.kte / sine_edge,
        process.krc * tangential + process.kre / sine_edge,
        process.kac * tangential + process.kae / sine_edge,
    )
