"""A joint that gets softer as it deflects."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion, saturated
from .protocol import Parameter

Real = NDArray[np.float64]


class StiffnessSoftening:
    """Contact that opens, preload lost, a drive that yields: part of the stiffness saturates beyond a knee."""

    name = "stiffness_softening"
    equation = "g = k (x / (1 + |x / x0|^n)^(1/n) - x): stiffness k is lost beyond the knee x0"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_loss_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("knee_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("sharpness", "", 0.3, 1.0, 12.0),
    )
    confusable_with = (
        "stiffness_hardening",
        "backlash",
        "hysteresis",
    )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection, n]) for k in (0.5, 1.0, 2.0, 4.0) for n in (2.0,))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        x = motion.deflections
        return JointLaw(reach=motion.reach, stiffness=values[0] * (saturated(x, values[1], values[2]) - x))


PHYSICS = StiffnessSoftening()
