"""Dry friction in a joint."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import DRY, Parameter
from .wider_forms import SHARPNESS, WiderFriction

Real = NDArray[np.float64]


class CoulombFriction:
    """A force of constant size against the velocity, smooth around standstill."""

    name = "coulomb_friction"
    beyond = "quadratic_damping"
    equation = "g = F_c tanh(v / v0)"
    source = "Coulomb 1785; Armstrong-Helouvry, Dupont & Canudas de Wit 1994, Automatica 30"
    parameters = (
        Parameter("friction_n", "N", 0.1, 0.0, 1e7, logarithmic=True),
        Parameter("smooth_velocity_m_per_s", "m/s", 0.3, 1e-9, 10.0, logarithmic=True),
    )
    confusable_with = (
        "hysteresis",
        "quadratic_damping",
    )

    def wider(self) -> tuple[WiderFriction, float]:
        """Return the law with one more shape number, and the value of that number at which it is nearly this law."""
        return WiderFriction((*self.parameters, SHARPNESS)), 2.6

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.velocity]) for k in (0.01, 0.03, 0.08))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        friction, smooth = self.held(values, motion)
        return JointLaw(speed=motion.speed, damping=friction * np.tanh(motion.velocities / smooth))

    def held(self, values: Real, motion: JointMotion) -> Real:
        """Return the numbers that the law uses: dry friction gives way within a small part of the motion."""
        return np.array([values[0], np.clip(values[1], 4e-4 * motion.speed, DRY * motion.velocity)])

    def strained(self, values: Real, motion: JointMotion) -> bool:
        """Tell whether the numbers ask for a force that still rises with speed, which is other damping."""
        return bool(values[1] > DRY * motion.velocity)


PHYSICS = CoulombFriction()
