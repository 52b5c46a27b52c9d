"""Stiffness that a joint gains beyond a knee, up to a limit: closing contacts, a preloaded gear on its second flank."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion, saturated
from .protocol import Parameter

Real = NDArray[np.float64]


class SaturatingHardening:
    """Hardening that ends: one stiffness at small deflections turns into another at large ones.

    It differs from :mod:`smooth backlash <mismatch.physics.smooth_backlash>` by a linear spring alone: here the
    nominal model holds at small deflections, there it holds at large ones. The law that asks for the less odd modes
    is taken.
    """

    name = "saturating_hardening"
    answers_as = "stiffness_hardening"
    twin = "smooth_backlash"
    equation = "g = k (x - x / (1 + |x / x0|^n)^(1/n)): stiffness k is gained beyond the knee x0"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_gain_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("knee_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("sharpness", "", 0.3, 1.0, 12.0),
    )
    confusable_with = (
        "backlash",
        "stiffness_softening",
    )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection, 2.0]) for k in (0.5, 1.0, 2.0))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        x = motion.deflections
        return JointLaw(reach=motion.reach, stiffness=values[0] * (x - saturated(x, values[1], values[2])))


PHYSICS = SaturatingHardening()
