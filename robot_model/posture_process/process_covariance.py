"""Covariance of the process between rows: a sum of parts, each with its own amplitude."""

import numpy as np
from numpy.typing import NDArray

from .posture_kernels import SquaredDistances, joint_kernels, whole_kernel
from .process_rows import DAMPING, FREQUENCY, SHAPE, Rows

Real = NDArray[np.float64]

PARTS = (
    "stiffness",
    "stiffness_over_postures",
    "mass",
    "frequency_over_postures",
    "frequency_scatter",
    "shape_over_postures",
    "shape_scatter",
    "damping",
    "joint_damping",
    "joint_damping_over_postures",
    "damping_scatter",
)
"""Amplitudes (standard deviations of logarithms, shapes as shares) of the covariance's parts."""

SCATTER = {FREQUENCY: 4, SHAPE: 6, DAMPING: 10}
"""Parts that differ from mode to mode and from posture to posture without any order."""


def covariance_parts(first: Rows, second: Rows, distances: SquaredDistances, length: float, same: bool) -> Real:
    """Covariances of two sets of rows for amplitudes of 1, (n_parts, n_first, n_second).

    ``s_1^2 J J^T`` of factors that are the same in every posture; ``s_2^2 sum_j J_j J_j^T k_j(q, q')`` of factors that
    vary; ``s_3^2 (u . u') k(q, q')`` of what no factor explains, where modes are alike in their energies u; and
    scatter.

    Parameters
    ----------
    distances
        Squared distances of the postures of the first list to those of the second.
    length
        Length scale of all kernels.
    same
        Whether both are the same rows: scatter is there on the diagonal alone.
    """
    place = np.ix_(first.posture, second.posture)
    joints = joint_kernels(distances, length)
    whole = whole_kernel(distances, length)[place]
    alike = (first.energy @ second.energy.T) * whole
    parts = np.zeros((len(PARTS), len(first), len(second)))
    parts[0] = first.stiffness @ second.stiffness.T
    parts[2] = first.mass @ second.mass.T
    parts[7] = np.outer(first.damping[:, 0], second.damping[:, 0])
    parts[8] = first.damping[:, 1:] @ second.damping[:, 1:].T
    for k, kernel in enumerate(joints):
        spread = kernel[place]
        parts[1] += np.outer(first.stiffness[:, k], second.stiffness[:, k]) * spread
        parts[9] += np.outer(first.damping[:, 1 + k], second.damping[:, 1 + k]) * spread
    parts[3] = alike * np.outer(first.kind == FREQUENCY, second.kind == FREQUENCY)
    parts[5] = alike * (first.motion @ second.motion.T) * (first.direction @ second.direction.T)
    if same:
        for kind, part in SCATTER.items():
            parts[part] = np.diag((first.kind == kind).astype(float))
    return parts
