"""A robot at some posture: three real modes at the tool tip, drawn at random."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from modal_fit import ModalModel

from ..robot_structure import TOOL_TIP

FREQUENCIES = ((10.0, 12.0), (15.0, 18.0), (22.0, 26.0))
"""Ranges of the natural frequencies, Hz: those of heavy articulated robots (Mohammadi & Ahmadi: 17 and 18 Hz)."""

DAMPING = (0.02, 0.06)
MASS = (180.0, 320.0)
"""Range of the modal masses at the tip, kg."""

SKEW = 0.2
"""How far the mode shapes depart from a right-angled triad."""


def posture_robot(generator: np.random.Generator) -> ModalModel:
    """Draw a robot: ``H(s) = sum_r phi_r phi_r^T / (s^2 + 2 zeta_r w_r s + w_r^2)`` at the tip.

    Parameters
    ----------
    generator
        Random generator that draws frequencies, damping, modal masses and directions.

    Returns
    -------
    ModalModel
        3 modes, responses and excitations ``TCP:+X +Y +Z``, receptance in m/N.

    Examples
    --------
    >>> posture_robot(np.random.default_rng(1)).right.shape
    (3, 3)
    """
    natural = 2 * np.pi * np.array([generator.uniform(*span) for span in FREQUENCIES])
    zeta = generator.uniform(*DAMPING, len(natural))
    triad = Rotation.random(random_state=generator).as_matrix() + SKEW * generator.uniform(-1, 1, (3, 3))
    shapes = triad / np.linalg.norm(triad, axis=1, keepdims=True)
    return real_modes(natural, zeta, shapes / np.sqrt(generator.uniform(*MASS, (3, 1))))


def real_modes(natural: NDArray[np.float64], zeta: NDArray[np.float64], shapes: NDArray[np.float64]) -> ModalModel:
    """Build the modal model at the tip from mass-normalised real shapes.

    Parameters
    ----------
    natural : (n_modes,), rad/s
        Angular natural frequencies.
    zeta : (n_modes,)
        Damping ratios of the modes.
    shapes : (n_modes, 3), kg^-1/2
        Mass-normalised shapes at the tip in X, Y, Z.
    """
    damped = natural * np.sqrt(1 - zeta**2)
    poles = -zeta * natural + 1j * damped
    return ModalModel(poles, shapes / (2j * damped[:, None]), shapes.astype(complex), TOOL_TIP, TOOL_TIP)
