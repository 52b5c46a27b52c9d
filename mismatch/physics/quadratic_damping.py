"""Damping that grows with the square of the velocity."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import Parameter
from .wider_forms import POWER, WiderDamping

Real = NDArray[np.float64]


class QuadraticDamping:
    """Lubricant and air, or hydraulic balancing: the force is proportional to v |v|."""

    name = "quadratic_damping"
    equation = "g = c2 |v| v"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (Parameter("damping_ns2_per_m2", "N s^2/m^2", 0.1, 0.0, 1e12, logarithmic=True),)
    confusable_with = ("coulomb_friction",)

    def wider(self) -> tuple[WiderDamping, float]:
        """Return the law with one more shape number, and the value of that number at which it is nearly this law."""
        return WiderDamping((*self.parameters, POWER)), 2.0

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return (np.array([1.0]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        v = motion.velocities
        return JointLaw(speed=motion.speed, damping=values[0] * np.abs(v) * v)


PHYSICS = QuadraticDamping()
