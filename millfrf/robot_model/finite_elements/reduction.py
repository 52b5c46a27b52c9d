"""Reduction of mass, damping and stiffness matrices to a `ModalModel` at the tool tip."""

from collections.abc import Sequence

import numpy as np
import scipy

from millfrf.core import InputError, Real
from modal_fit import ModalModel, Residuals


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
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
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


def modal_model(
    mass: Real,
    damping: Real,
    stiffness: Real,
    observed: Real,
    labels: Sequence[str],
    highest_frequency: float = np.inf,
) -> ModalModel:
    """Reduce ``M x'' + C x' + K x = S^T f``, ``y = S x`` to a modal model.

    Where the modes of M and K diagonalise C (modal, Rayleigh) they are real:
    ``phi phi^T / (2 i w_d) / (i w - pole) + conjugate``. Otherwise the poles and vectors of
    ``[[C, M], [M, 0]] s + [[K, 0], [0, -M]]`` are taken (Ewins, Modal Testing, 2nd ed., section 2.7).
    Modes above ``highest_frequency`` and overdamped ones are left as their static flexibility.

    Parameters
    ----------
    mass, damping, stiffness : (n, n), symmetric, mass positive definite
        Matrices M, C and K of the structure.
    observed : (n_labels, n)
        Matrix S: displacement of the labelled degrees of freedom over x.
    labels
        Degrees of freedom of responses and excitations, ``node:direction``.
    highest_frequency : Hz
        Highest undamped natural frequency that is kept as a mode.

    Raises
    ------
    InputError
        The structure is not held (lowest omega^2 not positive).
    """
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    if squares[0] <= 0:
        raise InputError(f"the structure is not held: lowest omega^2 = {squares[0]:.3g}; check stiffness and posture")
    modal = shapes.T @ damping @ shapes
    coupling = np.abs(modal - np.diag(np.diag(modal))).max(initial=0.0)
    if coupling <= 1e-9 * np.abs(modal).max(initial=0.0):
        return from_real_modes(squares, shapes, np.diag(modal), observed, labels, highest_frequency)
    return _from_complex_modes(mass, damping, stiffness, observed, labels, highest_frequency)


def from_real_modes(
    squares: Real,
    shapes: Real,
    modal_damping: Real,
    observed: Real,
    labels: Sequence[str],
    highest_frequency: float = np.inf,
) -> ModalModel:
    """The same from mass-normalised shapes (n, n_modes), omega^2 and ``2 zeta omega`` (n_modes,)."""
    natural = np.sqrt(squares)
    tip = (observed @ shapes).T
    kept = (natural < 2 * np.pi * highest_frequency) & (modal_damping < 2 * natural)
    damped = np.sqrt(squares[kept] - modal_damping[kept] ** 2 / 4)
    poles = -modal_damping[kept] / 2 + 1j * damped
    right = tip[kept].astype(complex)
    rest = tip[~kept] / natural[~kept, None]
    residuals = None if kept.all() else Residuals(rest.T @ rest, np.zeros((len(labels), len(labels))))
    return ModalModel(poles, right, right / (2j * damped[:, None]), tuple(labels), tuple(labels), residuals=residuals)


def _from_complex_modes(
    mass: Real, damping: Real, stiffness: Real, observed: Real, labels: Sequence[str], highest_frequency: float
) -> ModalModel:
    zero = np.zeros_like(mass)
    poles, vectors = scipy.linalg.eig(
        np.block([[-stiffness, zero], [zero, mass]]), np.block([[damping, mass], [mass, zero]])
    )
    kept = (poles.imag > 1e-9 * np.abs(poles)) & (np.abs(poles) < 2 * np.pi * highest_frequency)
    poles, upper = poles[kept], vectors[: len(mass), kept]
    order = np.argsort(np.abs(poles))
    poles, upper = poles[order], upper[:, order]
    norm = np.einsum("ir,ij,jr->r", upper, damping, upper) + 2 * poles * np.einsum("ir,ij,jr->r", upper, mass, upper)
    tip = (observed @ upper).T
    left = tip / norm[:, None]
    whole = observed @ np.linalg.solve(stiffness, observed.T)
    modes = 2 * np.real(np.einsum("rp,rq->pq", tip / -poles[:, None], left))
    rest = (whole - modes + (whole - modes).T) / 2
    negligible = np.abs(rest).max(initial=0.0) <= 1e-9 * np.abs(whole).max(initial=0.0)
    residuals = None if negligible else Residuals(rest, np.zeros_like(rest))
    return ModalModel(poles, tip, left, tuple(labels), tuple(labels), residuals=residuals)
