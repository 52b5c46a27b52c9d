"""Exact dynamic stiffness of a uniform beam in bending."""

from math import factorial

import numpy as np

from millfrf.core import Complex

from ..settings import SETTINGS


def bending_stiffness(
    bending: float, shear: float, mass: float, rotary: float, length: float, s: Complex, loss_factor: float
) -> Complex:
    """Compute the bending stiffness over ``(w, phi)`` of both ends, with shear and rotary inertia.

    ``w' = phi + V / (kappa G A)``, ``phi' = M / (E I)``, ``V' = s^2 rho A w``, ``M' = -V + s^2 rho I phi``
    (Timoshenko 1921). The exponential of this system is the transfer matrix; its power series, unlike the closed form,
    does not divide by a small ``1 - cos cosh``, so that it is exact at low frequencies.

    Parameters
    ----------
    bending : N m^2
        Bending stiffness ``E I``.
    shear : N
        Shear stiffness ``kappa G A``; infinite for an Euler-Bernoulli beam.
    mass : kg/m
        Mass per length ``rho A``.
    rotary : kg m
        Rotary inertia per length ``rho I``; 0 for an Euler-Bernoulli beam.
    length : m
        Length of the beam.
    s : (n_frequencies,), rad/s
        Laplace variable, ``i w``, or with the damping of an exponential window.
    loss_factor
        Structural loss factor: E and G are multiplied by ``1 + i loss_factor``.

    Returns
    -------
    (n_frequencies, 4, 4)
        Force (N) and moment (N m) on both ends over their deflections (m) and rotations (rad).

    Examples
    --------
    A clamped beam at rest is a spring of ``3 E I / L^3``:

    >>> stiffness = bending_stiffness(2.0, np.inf, 1.0, 0.0, 1.0, np.array([1e-3j]), 0.0)[0, 2:, 2:]
    >>> round(float(1 / np.linalg.inv(stiffness)[0, 0].real), 6)
    6.0
    """
    complex_bending = bending * (1 + 1j * loss_factor)
    frequency = -(s**2) * mass * length**4 / complex_bending
    # a long or fast beam is halved, because its transfer matrix is too ill-conditioned to be inverted
    wave_number = np.abs(frequency).max(initial=1e-9) ** 0.25
    halvings = max(0, int(np.ceil(np.log2(wave_number / SETTINGS.longest_transfer))))
    piece, shear_share, rotary_share = 0.5**halvings, bending / (shear * length**2), rotary / (mass * length**2)
    system = np.zeros((len(s), 4, 4), dtype=complex)
    system[:, 0, 1] = system[:, 1, 3] = piece
    system[:, 0, 2] = piece * shear_share
    system[:, 2, 0] = -piece * frequency
    system[:, 3, 2] = -piece
    system[:, 3, 1] = -piece * frequency * rotary_share
    summed = -frequency * (shear_share + rotary_share) * piece**2
    product = (frequency**2 * shear_share * rotary_share - frequency) * piece**4
    stiffness = _from_transfer(_exponential(system, summed, product))
    for _ in range(halvings):
        stiffness = _doubled(stiffness)
    scale = np.array([1 / length, 1.0, 1 / length, 1.0])
    return np.asarray(stiffness * (complex_bending / length) * np.outer(scale, scale))


def _exponential(system: Complex, summed: Complex, product: Complex) -> Complex:
    """Compute the exponential of matrices A (n, 4, 4) from sum and product (n,) of the two eigenvalues of ``A^2``.

    ``A^2k = u_k A^2 + v_k`` by Cayley and Hamilton, so that the power series has two numbers a term. With wave numbers
    up to :attr:`Settings.longest_transfer` its last term is below the rounding error.
    """
    u, v = np.zeros_like(summed), np.ones_like(summed)
    even, odd = np.zeros((2, 2, len(summed)), dtype=complex)
    for k in range(SETTINGS.transfer_terms):
        even += np.array([u, v]) / factorial(2 * k)
        odd += np.array([u, v]) / factorial(2 * k + 1)
        u, v = summed * u + v, -product * u
    square, unit = system @ system, np.eye(4)
    series = [term[0][:, None, None] * square + term[1][:, None, None] * unit for term in (even, odd)]
    return np.asarray(series[0] + system @ series[1])


def shear_factor(poisson: float, ratio: float) -> float:
    """Compute the shear factor of a round tube by its ratio of inner to outer diameter.

    ``kappa = 6 (1 + nu)(1 + m^2)^2 / ((7 + 6 nu)(1 + m^2)^2 + (20 + 12 nu) m^2)`` with ``m`` the ratio (Cowper 1966,
    The shear coefficient in Timoshenko's beam theory, Table 1).

    Examples
    --------
    >>> round(shear_factor(0.3, 0.0), 4)
    0.8864
    """
    square = (1 + ratio**2) ** 2
    return 6 * (1 + poisson) * square / ((7 + 6 * poisson) * square + (20 + 12 * poisson) * ratio**2)


def _from_transfer(transfer: Complex) -> Complex:
    """Convert the transfer matrix of a beam to its stiffness: forces on both ends over their displacements."""
    t11, t12, t21, t22 = transfer[:, :2, :2], transfer[:, :2, 2:], transfer[:, 2:, :2], transfer[:, 2:, 2:]
    inverse = np.linalg.inv(t12)
    top = np.concatenate([inverse @ t11, -inverse], axis=2)
    bottom = np.concatenate([t21 - t22 @ inverse @ t11, t22 @ inverse], axis=2)
    stiffness = np.concatenate([top, bottom], axis=1)
    return np.asarray((stiffness + stiffness.swapaxes(1, 2)) / 2)


def _doubled(piece: Complex) -> Complex:
    """Compute the stiffness of two equal pieces end to end, after elimination of their common node."""
    aa, ab, ba, bb = piece[:, :2, :2], piece[:, :2, 2:], piece[:, 2:, :2], piece[:, 2:, 2:]
    middle = np.linalg.inv(bb + aa)
    top = np.concatenate([aa - ab @ middle @ ba, -ab @ middle @ ab], axis=2)
    bottom = np.concatenate([-ba @ middle @ ba, bb - ba @ middle @ ab], axis=2)
    return np.concatenate([top, bottom], axis=1)
