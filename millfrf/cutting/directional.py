"""Directional coefficients of milling: the cutting force that a deflection of the tool causes."""

import math
from collections.abc import Callable
from functools import cache, partial
from itertools import pairwise

import numpy as np

from millfrf.core import Complex, Index, InputError, Real

from .cuts_in_words import refuse_varied
from .process import TURNING_IMMERSION, MillingProcess
from .tooth import chip_forces, thin_chip_immersions, tooth_force


def chip_direction(process: MillingProcess, angles: Real) -> Real:
    """Return the chip thickness per unit tool displacement, ``(sin phi sin gamma, cos phi sin gamma, -cos gamma)``.

    Parameters
    ----------
    process
        Cutter; gamma is its edge angle.
    angles : (n,), rad
        Immersion angles phi of one tooth; in turning phi is 90 deg at every spindle angle.

    Returns
    -------
    (n, 3)
    """
    angles = np.full(len(angles), TURNING_IMMERSION) if process.is_turning else angles
    sine, cosine = np.sin(process.edge_angle), np.cos(process.edge_angle)
    return np.column_stack([np.sin(angles) * sine, np.cos(angles) * sine, np.full(len(angles), -cosine)])


def force_direction(process: MillingProcess, angles: Real, tooth: int = 0) -> Real:
    """Return the change of force on the tool in X, Y, Z per depth and chip thickness for K_tc of 1 Pa.

    Coefficients that depend on the chip thickness are those of a small change of the stationary chip
    ``h = f sin(phi) sin(gamma)`` with the feed f of the tooth: :meth:`ChipLaw.slopes`. In turning the coefficients
    count per width of the edge, which is the depth over ``sin gamma``.

    The radial part of the Z row is ``+ k_rc cos gamma`` (Altintas, Manufacturing Automation, 2nd ed., section 2.8).
    Eq. 2 of Mohammadi & Ahmadi has a minus sign there, which would push the edge into the chip. For the cutter of the
    paper, gamma = 90 deg, the term is zero.

    Parameters
    ----------
    process
        Cutter and force coefficients.
    angles : (n,), rad
        Immersion angles phi of one tooth.
    tooth
        Number of the tooth; teeth at unequal pitch have different feeds.

    Returns
    -------
    (n, 3)
    """
    angles = np.full(len(angles), TURNING_IMMERSION) if process.is_turning else np.asarray(angles)
    chips = process.tooth_feeds[tooth] * np.sin(angles) * np.sin(process.edge_angle)
    return _on_tool(process, angles, process.chip_law.slopes(chips) * np.array([1.0, process.krc, process.kac]))


def _on_tool(process: MillingProcess, angles: Real, forces: Real) -> Real:
    """Return the force on the tool in X, Y, Z of tangential, radial and axial forces on a tooth, (n, 3)."""
    sine, cosine = np.sin(process.edge_angle), np.cos(process.edge_angle)
    tangential, radial, axial = forces.T
    normal, along = radial * sine + axial * cosine, radial * cosine - axial * sine
    if process.is_turning:
        return np.asarray(np.column_stack([-normal, tangential, along]) / sine)
    x = -tangential * np.cos(angles) - normal * np.sin(angles)
    y = tangential * np.sin(angles) - normal * np.cos(angles)
    return np.column_stack([x, y, along])


THIN = 1e-9  # sine of an immersion angle at which the chip vanishes


def thin_ends(process: MillingProcess) -> Real:
    """Return the immersion angles, rad, at which the cut begins or ends because the chip vanishes."""
    ends = [] if process.is_turning else [process.start_angle, process.exit_angle]
    return np.array([angle for angle in ends if abs(math.sin(angle)) < THIN])


def edge_end_harmonics(process: MillingProcess, orders: Index) -> Complex:
    """Return the Fourier coefficients of what edge forces add to ``K_tc alpha``, because a vibration moves their ends.

    Near an end at which the chip vanishes it is ``h = f |phi - phi_b| sin gamma + n . (x - x_tau)``: the edge cuts over
    a further angle ``n . (x - x_tau) / (f sin gamma)``, in which its edge force acts. The force is an impulse at the
    end ``phi_b`` and in proportion to the vibration, with the coefficients

    ``N / (2 pi) F_e(phi_b) n(phi_b)^T exp(-i k N phi_b) / (f sin gamma)``.

    Parameters
    ----------
    process
        Cutter and engagement with a feed per tooth; equal teeth with straight edges.
    orders : (n_orders,)
        Whole numbers k, negative ones too.

    Returns
    -------
    (n_orders, 3, 3), complex, Pa
    """
    ends, sine = thin_ends(process), math.sin(process.edge_angle)
    edge = np.tile(np.array([process.kte, process.kre, process.kae]) / sine, (len(ends), 1))
    product = _on_tool(process, ends, edge)[:, :, None] * chip_direction(process, ends)[:, None, :]
    wave = np.exp(-1j * process.teeth * np.outer(orders, ends))
    per_angle = process.teeth / (2 * np.pi * process.feed_per_tooth * sine)
    return np.asarray(per_angle * np.einsum("ke,eij->kij", wave, product))


def directional_matrix(process: MillingProcess, angles: Real) -> Real:
    """Return the matrix alpha of all teeth at spindle angles (Mohammadi & Ahmadi, Eq. 2-3).

    ``F = a K_tc alpha (X - X_tau)`` with the tool's position X now and X_tau one tooth period ago. Tooth j is
    ``tooth_angles[j]`` ahead of the spindle angle and cuts between start and exit angle. Edges are taken as straight;
    :func:`add_edge_forces` sums the forces of edges of any shape.

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
    for tooth, ahead in enumerate(process.tooth_angles):
        phi = np.mod(np.asarray(angles) + ahead, 2 * np.pi)
        cutting = (phi >= process.start_angle) & (phi < process.exit_angle)
        product = force_direction(process, phi, tooth)[:, :, None] * chip_direction(process, phi)[:, None, :]
        total += cutting[:, None, None] * product
    return total


def average_directional_matrix(process: MillingProcess) -> Real:
    """Return the mean of alpha over a tooth period, (3, 3), in closed form unless coefficients depend on the chip.

    Examples
    --------
    >>> half = MillingProcess(2, 0.0127, np.pi / 2, 119e6, 0.17, 0.33, np.pi / 2, np.pi, 1e-4)
    >>> (average_directional_matrix(half)[:, :2].round(3)).tolist()
    [[0.117, -0.223], [0.277, -0.202], [-0.105, 0.105]]
    """
    if process.is_turning:
        return np.asarray(directional_matrix(process, np.zeros(1))[0])
    if process.chip_law.varies:
        return np.asarray(turn_harmonics(process, np.zeros(1, dtype=int)).sum(axis=0)[0].real)
    start, stop = process.start_angle, process.exit_angle
    sine, cosine = np.sin(process.edge_angle), np.cos(process.edge_angle)
    normal = process.krc * sine + process.kac * cosine
    axial = process.krc * cosine - process.kac * sine
    # integrals over the immersion of 1, sin, cos, sin^2, cos^2 and sin cos
    width = stop - start
    s = np.cos(start) - np.cos(stop)
    c = np.sin(stop) - np.sin(start)
    ss = (stop / 2 - np.sin(2 * stop) / 4) - (start / 2 - np.sin(2 * start) / 4)
    cc = width - ss
    sc = np.sin(stop) ** 2 / 2 - np.sin(start) ** 2 / 2
    matrix = np.array(
        [
            [sine * (-sc - normal * ss), sine * (-cc - normal * sc), -cosine * (-c - normal * s)],
            [sine * (ss - normal * sc), sine * (sc - normal * cc), -cosine * (s - normal * c)],
            [sine * axial * s, sine * axial * c, -cosine * axial * width],
        ]
    )
    return np.asarray(process.teeth / (2 * np.pi) * matrix)


def directional_harmonics(process: MillingProcess, orders: Index, depth: float = 0.0) -> Complex:
    """Return the Fourier coefficients of alpha over the tooth passing, ``alpha(t) = sum_k alpha_k exp(i k N Omega t)``.

    ``alpha_k = N / (2 pi) integral over the immersion of alpha_tooth(phi) exp(-i k N phi)``, tooth 0 at +Y at t = 0;
    order 0 is :func:`average_directional_matrix` (Budak & Altintas 1998, Eq. 9). A helical edge lags its tip by up to
    L at the depth; the mean of ``exp(-i k N l)`` over the lags l from 0 to L multiplies the coefficient k.

    Parameters
    ----------
    process
        Cutter and engagement; equal teeth.
    orders : (n_orders,)
        Whole numbers k, negative ones too.
    depth : m
        Axial depth of the mean over a helical edge; 0: at the tip.

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
    half = orders * process.lag(depth) / 2
    averaged = np.exp(-1j * half) * np.sinc(half / np.pi)
    return np.asarray(process.teeth * _tooth_harmonics(process, orders, force_direction) * averaged[:, None, None])


def turn_harmonics(process: MillingProcess, orders: Index) -> Complex:
    """Return Fourier coefficients of each tooth over a revolution, ``alpha_j(t) = sum_k alpha_jk exp(i k Omega t)``.

    They are needed for unequal pitch; the angle ``tooth_angles[j]`` shifts the phase of tooth j.

    Returns
    -------
    (teeth, n_orders, 3, 3), complex
    """
    ahead = np.exp(1j * np.outer(process.tooth_angles, orders))
    different = range(process.teeth if process.chip_law.varies else 1)
    single = [_tooth_harmonics(process, np.asarray(orders), partial(force_direction, tooth=j), j) for j in different]
    return np.asarray(ahead[:, :, None, None] * np.array(single))


def damping_harmonics(process: MillingProcess, orders: Index) -> Complex:
    """Return the Fourier coefficients over a revolution of the sum over teeth of ``n n^T``, (n_orders, 3, 3).

    n is the surface normal at a tooth. The coefficients describe process damping; see ``damping_matrices``.
    """
    ahead = np.exp(1j * np.outer(process.tooth_angles, orders)).sum(axis=0)
    return np.asarray(ahead[:, None, None] * _tooth_harmonics(process, np.asarray(orders), chip_direction))


_gauss = cache(np.polynomial.legendre.leggauss)  # the rules take longer to compute than to use


def _tooth_harmonics(
    process: MillingProcess, orders: Index, direction: Callable[[MillingProcess, Real], Real], tooth: int = 0
) -> Complex:
    """Integrate over the immersion of one tooth, for each order k, (n_orders, 3, 3).

    The result is ``1 / (2 pi) int direction(phi) chip(phi)^T exp(-i k phi) dphi``.
    """
    fastest, total = int(np.abs(orders).max(initial=0)) + 2, np.zeros((len(orders), 3, 3), dtype=complex)
    bounds = (process.start_angle, *thin_chip_immersions(process, tooth), process.exit_angle)
    for low, high in pairwise(bounds):
        # as many Gauss points as the fastest wave needs: its number of turns in the immersion grows with the order
        nodes, weights = _gauss(20 + int(0.6 * fastest * (high - low)))
        phi = low + (high - low) / 2 * (nodes + 1)
        product = direction(process, phi)[:, :, None] * chip_direction(process, phi)[:, None, :]
        wave = np.exp(-1j * orders[:, None] * phi) * (weights * (high - low) / 2)
        total += np.einsum("kn,nij->kij", wave, product) / (2 * np.pi)
    return total


def force_harmonics(process: MillingProcess, n_harmonics: int) -> Complex:
    """Return the Fourier coefficients c_h of the force of a stable cut per metre of depth.

    ``F(t) = c_0 + sum_h 2 Re(c_h exp(i h N W t))`` with
    ``c_h = N / (2 pi) int f(phi) exp(-i h N phi) dphi`` over the immersion, where f is the force of one tooth with the
    chip thickness ``feed sin(phi) sin(gamma)`` and edge forces (Altintas, Manufacturing Automation, 2nd ed., section
    2.7). Runout, which adds lines between these harmonics, is left out.

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
    refuse_varied(process, "the plan of excitation", "give straight edges at equal pitch", takes=("damping", "runout"))
    nodes, weights = _gauss(200)  # more than enough for a few waves of a smooth function
    total = np.zeros((n_harmonics + 1, 3), dtype=complex)
    for low, high in pairwise((process.start_angle, *thin_chip_immersions(process, 0), process.exit_angle)):
        angles = low + (high - low) / 2 * (nodes + 1)
        waves = np.exp(-1j * process.teeth * np.outer(np.arange(n_harmonics + 1), angles))
        total += process.teeth / (4 * math.pi) * (high - low) * (waves * weights) @ _forces_of_tooth(process, angles)
    return total


def _forces_of_tooth(process: MillingProcess, angles: Real) -> Real:
    """Return the force of one tooth per depth, (n, 3), N/m, at immersion angles (n,), rad."""
    sine_edge, cosine_edge = math.sin(process.edge_angle), math.cos(process.edge_angle)
    local = chip_forces(process, process.feed_per_tooth * np.sin(angles) * sine_edge)
    local = local + np.array([process.kte, process.kre, process.kae]) / sine_edge
    return np.array(
        [
            tooth_force(math.sin(angle), math.cos(angle), sine_edge, cosine_edge, *(float(part) for part in forces))
            for angle, forces in zip(angles, local, strict=True)
        ]
    )
