"""How far a posture stands from joint limits and from singularities."""

import numpy as np
from numpy.typing import NDArray

from ..kinematics import Mechanism, tool_jacobian

Real = NDArray[np.float64]


def limit_margin(mechanism: Mechanism, q: Real) -> float:
    """Distance to the nearest joint limit, rad (prismatic joints: m); infinite without limits, negative beyond one."""
    frames = [mechanism.frames[index] for index in mechanism.moving]
    return float(min(min(value - f.lower, f.upper - value) for f, value in zip(frames, q, strict=True)))


def singular_values(mechanism: Mechanism, q: Real) -> tuple[float, float]:
    """Smallest singular value of the tool Jacobian (m, rad) and its condition number.

    Rows count as they are, m and rad: translations and rotations weigh alike at an arm of 1 m. At a singularity the
    smallest value is zero: no joint motion moves the tool in one direction.
    """
    values = np.linalg.svd(tool_jacobian(mechanism, q), compute_uv=False)
    return float(values[-1]), float(values[0] / max(values[-1], 1e-300))
