"""Damping matrices: any set of modal damping ratios, and Rayleigh's two constants."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from foundation import InputError

Real = NDArray[np.float64]


def modal_damping_matrix(mass: Real, stiffness: Real, ratios: Real) -> Real:
    """Compute ``C = M Phi diag(2 zeta_n omega_n) Phi^T M`` with ``Phi^T M Phi = I``, N s/m.

    Clough & Penzien, Dynamics of Structures, section 12-5; Chen et al. 2026, Eq. 20.

    Parameters
    ----------
    mass, stiffness : (n, n), symmetric
        Mass and stiffness matrix.
    ratios : (n,)
        Damping ratio of each mode in rising frequency.

    Raises
    ------
    InputError
        Another number of ratios than of modes, or a structure that is not held (negative or zero stiffness).
    """
    given = np.asarray(ratios, dtype=float)
    if given.shape != (len(mass),):
        raise InputError(f"{given.size} damping ratios for {len(mass)} modes; give one a mode")
    squares, shapes = eigh(stiffness, mass)
    if squares[0] <= 0:
        raise InputError(f"the structure is not held: lowest omega^2 = {squares[0]:.3g}; check stiffness and posture")
    carried = mass @ shapes
    return np.asarray((carried * (2 * given * np.sqrt(squares))) @ carried.T)


def rayleigh_constants(frequencies: tuple[float, float], ratios: tuple[float, float]) -> tuple[float, float]:
    """Constants of ``C = a M + b K`` from two damping ratios at two frequencies (Hz): ``zeta = (a / w + b w) / 2``.

    Mousavi et al., Eqs. 9-11; their Eq. 11 as printed has a and b the other way round.

    Returns
    -------
    (a, b), 1/s and s

    Raises
    ------
    InputError
        Frequencies that are not positive and different.

    Examples
    --------
    >>> [float(f"{c:.5g}") for c in rayleigh_constants((5.9, 8.2), (0.065, 0.065))]
    [2.8027, 0.0014674]
    """
    low, high = 2 * np.pi * np.asarray(frequencies, dtype=float)
    if not (low > 0 and high > 0 and low != high):
        raise InputError(f"Rayleigh damping needs two different positive frequencies, not {frequencies}")
    a, b = np.linalg.solve([[0.5 / low, 0.5 * low], [0.5 / high, 0.5 * high]], np.asarray(ratios, dtype=float))
    return float(a), float(b)
