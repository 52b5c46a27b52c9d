"""Modes of a robot whose joints, links and bodies are corrected by factors, and how they move with the factors."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from ...spatial import SpatialRobot
from .modal_basis import ModalBasis

Real = NDArray[np.float64]

CLOSE = 0.02
"""Relative distance of two squared frequencies below which their shapes' derivatives are kept from growing."""


@dataclass(frozen=True)
class CorrectedModes:
    """Modes under corrections.

    Parameters
    ----------
    natural : (n_modes,), rad/s
        Angular natural frequencies, rising.
    vectors : (n_modes, n_modes)
        Mass-normalised shapes over the basis, as columns.
    tip : (n_modes, 3), kg^-1/2
        Motion of the tip in each mode, base frame.
    shares : (n_modes, n_stiffnesses)
        Share of each elastic part in a mode's energy.
    masses : (n_modes, n_masses)
        Share of each mass in it.
    """

    natural: Real
    vectors: Real
    tip: Real
    shares: Real
    masses: Real


def corrected_modes(basis: ModalBasis, stiffness: Real, mass: Real) -> CorrectedModes:
    """Solve ``(diag(w^2) + sum_k (e^s_k - 1) G_k) v = lambda (I + sum_b (e^m_b - 1) M_b) v``.

    Parameters
    ----------
    basis
        Modes as modelled, in the posture.
    stiffness : (n_stiffnesses,)
        Logarithms s of the factors of the elastic parts.
    mass : (n_masses,)
        Logarithms m of the factors of the masses.
    """
    parts = np.exp(stiffness)[:, None, None] * basis.stiffness
    inertias = np.exp(mass)[:, None, None] * basis.mass
    whole = np.diag(basis.squares) + np.tensordot(np.expm1(stiffness), basis.stiffness, 1)
    inertia = np.eye(len(whole)) + np.tensordot(np.expm1(mass), basis.mass, 1)
    squares, vectors = eigh(whole, inertia)
    squares = np.maximum(squares, 1e-6 * basis.squares[0])
    shares = np.einsum("ir,kij,jr->rk", vectors, parts, vectors, optimize=True) / squares[:, None]
    masses = np.einsum("ir,bij,jr->rb", vectors, inertias, vectors, optimize=True)
    return CorrectedModes(np.sqrt(squares), vectors, vectors.T @ basis.tip, shares, masses)


def shape_slopes(basis: ModalBasis, modes: CorrectedModes, stiffness: Real, mass: Real, mode: int) -> tuple[Real, Real]:
    """Derivatives of one mode's motion of the tip by the logarithms, (3, n_stiffnesses) and (3, n_masses).

    ``dphi_r = sum_s phi_s v_s^T (dK - lambda_r dM) v_r / (lambda_r - lambda_s) - phi_r v_r^T dM v_r / 2`` (Fox &
    Kapoor, AIAA Journal 6, 1968); where two modes are close, the fraction is kept from growing.
    """
    square = modes.natural[mode] ** 2
    gap = (square - modes.natural**2) / square
    pull = gap / (gap**2 + CLOSE**2) / square
    pull[mode] = 0.0
    vector = modes.vectors[:, mode]
    by_stiffness = np.exp(stiffness) * (modes.vectors.T @ (basis.stiffness @ vector).T)
    by_mass = np.exp(mass) * (modes.vectors.T @ (basis.mass @ vector).T)
    mixed = pull[:, None] * by_stiffness, -square * pull[:, None] * by_mass
    own = np.outer(modes.tip[mode], modes.masses[mode]) / 2
    return modes.tip.T @ mixed[0], modes.tip.T @ mixed[1] - own


def modelled_damping(robot: SpatialRobot, natural: Real) -> Real:
    """Damping ratios that the robot's file gives at angular frequencies (rad/s): one ratio, or Rayleigh's."""
    if robot.damping_ratio is not None:
        return np.full(len(natural), max(robot.damping_ratio, SMALLEST_RATIO))
    a, b = robot.rayleigh
    return np.maximum((a / natural + b * natural) / 2, SMALLEST_RATIO)


SMALLEST_RATIO = 1e-4
"""Damping ratio that stands in where a file gives none: a logarithm needs one."""
