"""Laws of a joint that a linear model leaves out: the force against its deflection. Compiled."""

import math

import numpy as np
from numpy.typing import NDArray

from cutting.compilation import compiled

JOINT_LAWS = {
    "linear": 0,
    "stiffness_hardening": 1,
    "stiffness_softening": 2,
    "backlash": 3,
    "coulomb_friction": 4,
    "hysteresis": 5,
    "pose_drift": 6,
    "stiffness_modulation": 7,
}
"""Number of each law in :func:`joint_force`. The last is in no library: nothing should be named."""


@compiled
def joint_force(law: int, p: NDArray[np.float64], x: float, v: float, time: float, stretch: float) -> float:
    """Compute the force of the joint, N, against its deflection.

    Parameters
    ----------
    law
        Number of the law, from :data:`JOINT_LAWS`.
    p : (3,)
        Parameters of the law. 1: cubic stiffness (N/m^3), ``p0 x^3``. 2: stiffness lost (N/m), knee (m), ``p0 (p1
        atan(x / p1) - x)``. 3: stiffness lost (N/m) within half a gap (m), ``-p0 x`` there. 4: friction (N), creep
        speed (m/s), ``p0 v / sqrt(v^2 + p1^2)``. 5: stiffness (N/m) of the stretch. 6: stiffness change (N/m) over a
        duration (s), ``p0 (t / p1 - 1/2) x``. 7: stiffness (N/m) at an angular frequency (rad/s), ``p0 cos(p1 t) x``.
    x, v
        Deflection (m) and velocity (m/s) of the joint.
    time : s
        Time since the beginning of the recording.
    stretch : m
        Stretch of the element with memory.
    """
    if law == 1:
        return float(p[0] * x * x * x)
    if law == 2:
        return float(p[0] * (p[1] * math.atan(x / p[1]) - x))
    if law == 3:
        return float(-p[0] * min(max(x, -p[1]), p[1]))
    if law == 4:
        return float(p[0] * v / math.sqrt(v * v + p[1] * p[1]))
    if law == 5:
        return float(p[0] * stretch)
    if law == 6:
        return float(p[0] * (time / p[1] - 0.5) * x)
    if law == 7:
        return float(p[0] * math.cos(p[1] * time) * x)
    return 0.0


@compiled
def stretched(law: int, p: NDArray[np.float64], stretch: float, moved: float) -> float:
    """Stretch (m) of the hysteretic element after the joint has moved by ``moved`` (m).

    ``dz = dx (1 - (beta sign(z dx) + gamma) |z|)`` with ``beta = p1``, ``gamma = p2`` in 1/m (Bouc 1967; Wen 1976, with
    exponent 1), by Heun's method.
    """
    if law != 5:
        return 0.0
    first = moved * (1.0 - (p[1] * np.sign(stretch * moved) + p[2]) * abs(stretch))
    trial = stretch + first
    second = moved * (1.0 - (p[1] * np.sign(trial * moved) + p[2]) * abs(trial))
    return float(stretch + 0.5 * (first + second))
