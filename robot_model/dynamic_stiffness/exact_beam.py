"""Exact dynamic stiffness of uniform beams, Euler-Bernoulli and Timoshenko: no discretisation at any frequency."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from ..finite_elements.section import Section

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

_PIECE = 3.0
"""Largest bending wave number times length of a piece whose transfer matrix is inverted."""


def planar_dynamic_stiffness(section: Section, length: float, omega: Real, loss_factor: float = 0.0) -> Complex:
    """Give the forces over displacements of the two ends of a beam, in the local x-y plane.

    Displacements ``(u, v, phi)`` of the first end, then of the second; forces ``(N, Q, M)`` on the beam in the same
    order. Chen et al. 2026, Eq. 2 and appendix (whose printed coefficients lost their signs in the text).

    Parameters
    ----------
    section, length
        Cross-section of the uniform beam, and its length (m).
    omega : (n_frequencies,), rad/s
        Angular frequencies. Zero is allowed: it gives the static stiffness.
    loss_factor
        Loss factor of the material: E and G become ``E (1 + i loss_factor)``.

    Returns
    -------
    (n_frequencies, 6, 6), symmetric, N/m, N and N m
    """
    stiffness = np.zeros((len(omega), 6, 6), dtype=complex)
    along = [0, 3]
    across = [1, 2, 4, 5]
    stiffness[np.ix_(range(len(omega)), along, along)] = _rod(section.axial, section.mass, length, omega, loss_factor)
    bend = _bending(section.bending_z, section.shear_y, section.mass, section.rotary_z, length, omega, loss_factor)
    stiffness[np.ix_(range(len(omega)), across, across)] = bend
    return stiffness


def spatial_dynamic_stiffness(section: Section, length: float, omega: Real, loss_factor: float = 0.0) -> Complex:
    """The same in space: ``(u, v, w, theta_x, theta_y, theta_z)`` of both ends, shape (n_frequencies, 12, 12).

    Bending in the x-z plane has the slope ``dw/dx = -theta_y``.
    """
    n = range(len(omega))
    stiffness = np.zeros((len(omega), 12, 12), dtype=complex)
    stiffness[np.ix_(n, [0, 6], [0, 6])] = _rod(section.axial, section.mass, length, omega, loss_factor)
    stiffness[np.ix_(n, [3, 9], [3, 9])] = _rod(section.torsion, section.polar, length, omega, loss_factor)
    in_xy = _bending(section.bending_z, section.shear_y, section.mass, section.rotary_z, length, omega, loss_factor)
    in_xz = _bending(section.bending_y, section.shear_z, section.mass, section.rotary_y, length, omega, loss_factor)
    sign = np.array([1.0, -1.0, 1.0, -1.0])
    stiffness[np.ix_(n, [1, 5, 7, 11], [1, 5, 7, 11])] = in_xy
    stiffness[np.ix_(n, [2, 4, 8, 10], [2, 4, 8, 10])] = in_xz * np.outer(sign, sign)
    return stiffness


def _rod(stiffness: float, mass: float, length: float, omega: Real, loss_factor: float) -> Complex:
    """Axial or torsional waves: ``(E A / L) (mu / sin mu) [[cos mu, -1], [-1, cos mu]]``, mu = omega L / c."""
    complex_stiffness = stiffness * (1 + 1j * loss_factor)
    mu = omega * length * np.sqrt(mass / complex_stiffness)
    scale = complex_stiffness / length / np.sinc(mu / np.pi)
    rod = np.empty((len(omega), 2, 2), dtype=complex)
    rod[:, 0, 0] = rod[:, 1, 1] = scale * np.cos(mu)
    rod[:, 0, 1] = rod[:, 1, 0] = -scale
    return rod


def _bending(
    bending: float, shear: float, mass: float, rotary: float, length: float, omega: Real, loss_factor: float
) -> Complex:
    """Displacements ``(w, phi)`` of both ends, from the transfer matrix of a piece, pieces then joined by doubling.

    ``w' = phi + V / (kappa G A)``, ``phi' = M / (E I)``, ``V' = -omega^2 rho A w``, ``M' = -V - omega^2 rho I phi``
    (Timoshenko 1921). The exponential has no division by a small ``1 - cos cosh``, so low frequencies lose nothing.
    """
    complex_bending = bending * (1 + 1j * loss_factor)
    frequency = omega**2 * mass * length**4 / complex_bending
    halvings = max(0, int(np.ceil(np.log2(np.abs(frequency).max(initial=1e-9) ** 0.25 / _PIECE))))
    system = np.zeros((len(omega), 4, 4), dtype=complex)
    system[:, 0, 1] = 1
    system[:, 0, 2] = bending / (shear * length**2)
    system[:, 1, 3] = 1
    system[:, 2, 0] = -frequency
    system[:, 3, 2] = -1
    system[:, 3, 1] = -frequency * rotary / (mass * length**2)
    stiffness = _from_transfer(expm(system / 2**halvings))
    for _ in range(halvings):
        stiffness = _doubled(stiffness)
    scale = np.array([1 / length, 1.0, 1 / length, 1.0])
    return np.asarray(stiffness * (complex_bending / length) * np.outer(scale, scale))


def _from_transfer(transfer: Complex) -> Complex:
    """Transfer matrix of (displacements, inner forces) to stiffness: forces on the ends over displacements."""
    t11, t12, t21, t22 = transfer[:, :2, :2], transfer[:, :2, 2:], transfer[:, 2:, :2], transfer[:, 2:, 2:]
    inverse = np.linalg.inv(t12)
    top = np.concatenate([inverse @ t11, -inverse], axis=2)
    bottom = np.concatenate([t21 - t22 @ inverse @ t11, t22 @ inverse], axis=2)
    stiffness = np.concatenate([top, bottom], axis=1)
    return np.asarray((stiffness + stiffness.swapaxes(1, 2)) / 2)


def _doubled(piece: Complex) -> Complex:
    """Two equal pieces in a row, their common node condensed."""
    aa, ab, ba, bb = piece[:, :2, :2], piece[:, :2, 2:], piece[:, 2:, :2], piece[:, 2:, 2:]
    middle = np.linalg.inv(bb + aa)
    top = np.concatenate([aa - ab @ middle @ ba, -ab @ middle @ ab], axis=2)
    bottom = np.concatenate([-ba @ middle @ ba, bb - ba @ middle @ ab], axis=2)
    return np.concatenate([top, bottom], axis=1)
