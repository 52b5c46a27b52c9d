"""Structures of the simulated cell: Table 1 of Mohammadi & Ahmadi, and robots drawn at random."""

from collections.abc import Sequence

import numpy as np
import scipy

from millfrf.core import HOUSING, TIP, Complex, InputError, Real
from modal_fit import ModalModel

from .settings import SETTINGS

_TABLE_ONE_FREQUENCIES = (16.99, 18.48)  # Hz
_TABLE_ONE_DAMPING = (0.0285, 0.0996)
_TABLE_ONE_LEFT = (
    (-18.34e-4 - 5.34e-4j, -51.47e-4 + 48.61e-4j, -17.10e-4 + 16.37e-4j),
    (32.31e-4 - 76.26e-4j, -28.53e-4 + 3.08e-4j, -5.08e-4 + 6.72e-4j),
)
_TABLE_ONE_RIGHT = (
    (-20.57e-4 - 7.18e-4j, -39.21e-4 + 55.05e-4j, -13.93e-4 + 14.31e-4j),
    (50.46e-4 - 17.77e-4j, -23.99e-4 - 13.26e-4j, -2.78e-4 + 6.96e-4j),
)

# modes above the band of Table 1, and the rigid spindle assembly; all assumed, see default_structure
_OUTER_FREQUENCIES = (52.0, 83.0, 127.0)  # Hz
_OUTER_DAMPING = (0.04, 0.03, 0.025)
_OUTER_COMPLIANCE = (2.5e-7, 2.0e-7, 0.8e-7)  # m/N
_OUTER_DIRECTIONS = ((0.8, 0.6, 0.0), (-0.6, 0.8, 0.0), (0.0, 0.0, 1.0))
SENSOR_FROM_TIP = (0.06, -0.04, 0.25)  # m
_TIP_FROM_AXIS = (  # m, one row per mode: position of the tip relative to the axis of rotation
    (0.45, -0.20, -1.50),
    (-0.30, 0.35, -1.05),
    (0.20, 0.10, -1.15),
    (-0.15, 0.25, -1.35),
    (0.30, -0.10, -1.80),
)


def table_one_model() -> ModalModel:
    """Return the two modes identified in the cut on a KUKA KR90 R3100, motion and forces at the tool tip.

    Mohammadi & Ahmadi, In-process FRF measurement for robotic milling, Table 1. The table states the entries times
    10^4.

    Returns
    -------
    ModalModel
        Natural frequencies 16.99 and 18.48 Hz, damping ratios 2.85 and 9.96 %.

    Examples
    --------
    >>> table_one_model().natural_frequencies.round(2).tolist()
    [16.99, 18.48]
    """
    poles = _poles(_TABLE_ONE_FREQUENCIES, _TABLE_ONE_DAMPING)
    return ModalModel(poles, np.array(_TABLE_ONE_RIGHT), np.array(_TABLE_ONE_LEFT), TIP, TIP)


def default_structure() -> ModalModel:
    """Return the modes of Table 1 and three modes above its band, with motion at the tool tip and the spindle housing.

    Table 1 alone cannot be a mechanical structure: ``R = sum 2 Re(right left^T)`` is not zero, so that a step of force
    would give a step of velocity. The missing part belongs to modes outside its band. The modes added here have
    orthonormal directions d_k, left vectors d_k and right vectors ``-i b_k d_k - (R / 2) d_k``; as
    ``sum d_k d_k^T = I``, all modes together give ``sum 2 Re(right left^T) = 0``, at the tip and at the housing. The
    b_k are set by a compliance of 0.08 to 0.25 um/N each, 1 to 6 % of the direct peaks of Table 1.

    In every mode the tool, holder and spindle housing turn as one rigid body about an axis 1.1 to 1.8 m from the tip
    (the robot's joints): ``psi = d x t / |d|^2`` with t the motion of the tip and d its place relative to the axis. The
    sensor at ``r`` from the tip moves by ``t + psi x r`` (Mohammadi & Ahmadi, Fig. 12 a), 0.75 to 0.95 of the tip's
    motion in the two modes of Table 1.

    The frequencies, damping, compliance and directions of modes 3 to 5, the axes and r are assumed: the paper has none.

    Returns
    -------
    ModalModel
        5 modes, responses ``TCP:+X +Y +Z HOUSING:+X +Y +Z``, excitations ``TCP:+X +Y +Z``.

    Examples
    --------
    >>> structure = default_structure()
    >>> structure.natural_frequencies.round(2).tolist()
    [16.99, 18.48, 52.0, 83.0, 127.0]
    """
    inner = table_one_model()
    axes, directions = np.array(_TIP_FROM_AXIS), np.array(_OUTER_DIRECTIONS)
    outer_poles = _poles(_OUTER_FREQUENCIES, _OUTER_DAMPING)
    strength = 0.5 * np.array(_OUTER_COMPLIANCE) * np.abs(outer_poles)
    inner_motion = _motion_about(axes[:2], inner.right)
    feed_through = 2 * np.real(np.einsum("rp,rq->pq", inner_motion, inner.left))
    outer_motion = _motion_about(axes[2:], -1j * strength[:, None] * directions) - 0.5 * directions @ feed_through.T
    motion = np.vstack([inner_motion, outer_motion])
    housing = motion[:, :3] + np.cross(motion[:, 3:], np.array(SENSOR_FROM_TIP))
    return ModalModel(
        np.concatenate([inner.poles, outer_poles]),
        np.hstack([motion[:, :3], housing]),
        np.vstack([inner.left, directions.astype(complex)]),
        TIP + HOUSING,
        TIP,
    )


def _motion_about(tip_from_axis: Real, tip: Complex) -> Complex:
    """Return the translation of the tip and the smallest rotation about the axes that causes it, (n_modes, 6)."""
    squared_distance = np.sum(tip_from_axis**2, axis=1, keepdims=True)
    return np.hstack([tip, np.cross(tip_from_axis, tip) / squared_distance])


def tip_model(structure: ModalModel) -> ModalModel:
    """Return the model with only the responses and excitations at the tool tip, in the order X, Y, Z.

    Raises
    ------
    InputError
        The structure has no motion or no force at the tool tip in one of the directions.
    """
    return select(structure, TIP, TIP)


def select(structure: ModalModel, responses: Sequence[str], excitations: Sequence[str]) -> ModalModel:
    """Return the model with only these responses and excitations, in this order.

    Raises
    ------
    InputError
        The structure lacks a degree of freedom, or has residuals (which the simulation cannot represent).
    """
    if structure.residuals is not None:
        raise InputError("the structure has residuals; describe the motion out of band by modes to simulate with it")
    for needed, present in ((responses, structure.responses), (excitations, structure.excitations)):
        missing = [name for name in needed if name not in present]
        if missing:
            raise InputError(f"the structure has no {', '.join(missing)}; it has {', '.join(present)}")
    rows = [structure.responses.index(name) for name in responses]
    columns = [structure.excitations.index(name) for name in excitations]
    return ModalModel(
        structure.poles,
        structure.right[:, rows],
        structure.left[:, columns],
        tuple(responses),
        tuple(excitations),
        structure.quantity,
        structure.unit,
        physics=structure.physics,
    )


def _poles(frequencies: Sequence[float], damping: Sequence[float]) -> Complex:
    natural, zeta = 2 * np.pi * np.array(frequencies), np.array(damping)
    return np.asarray(natural * (-zeta + 1j * np.sqrt(1 - zeta**2)))


def posture_robot(generator: np.random.Generator) -> ModalModel:
    """Draw a random robot: ``H(s) = sum_r phi_r phi_r^T / (s^2 + 2 zeta_r w_r s + w_r^2)`` at the tip.

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
    natural = 2 * np.pi * np.array([generator.uniform(*limits) for limits in SETTINGS.natural_frequencies])
    zeta = generator.uniform(*SETTINGS.damping_ratios, len(natural))
    triad = scipy.spatial.transform.Rotation.random(random_state=generator).as_matrix()
    triad = triad + SETTINGS.shape_skew * generator.uniform(-1, 1, (3, 3))
    shapes = triad / np.linalg.norm(triad, axis=1, keepdims=True)
    return real_modes(natural, zeta, shapes / np.sqrt(generator.uniform(*SETTINGS.modal_masses, (3, 1))))


def real_modes(natural: Real, zeta: Real, shapes: Real) -> ModalModel:
    """Return the model at the tip with mass-normalised real shapes (n_modes, 3), kg^-1/2; ``natural`` in rad/s."""
    damped = natural * np.sqrt(1 - zeta**2)
    poles = -zeta * natural + 1j * damped
    return ModalModel(poles, shapes / (2j * damped[:, None]), shapes.astype(complex), TIP, TIP)
