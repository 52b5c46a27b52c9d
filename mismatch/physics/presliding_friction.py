"""Dry friction that gives way a little before it slides."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import DRY, Parameter
from .wider_forms import SPREAD, WiderPresliding

Real = NDArray[np.float64]

ELEMENTS = 6
"""Number of elements in parallel, of equal force; their yields are spread evenly in the logarithm."""

LEAST_PRESLIDING = 2e-3
"""Least presliding as a share of the typical deflection: less is friction without presliding, too stiff for any time
step."""


class PreslidingFriction:
    """Asperities act as springs until they break away: sliding begins after some micrometres, not at once.

    Without presliding it becomes Coulomb's friction, and it is reported under that name; where most of the motion is
    presliding it becomes :mod:`hysteresis <mismatch.physics.hysteresis>`.
    """

    name = "presliding_friction"
    answers_as = "coulomb_friction"
    beyond = "hysteresis"
    equation = "g = F_c p(x): a force that follows the deflection since the last turn, and slides at F_c"
    source = "Dahl 1968, Aerospace Corp. TOR-0158; Canudas de Wit, Olsson, Astrom & Lischinsky 1995, IEEE TAC 40"
    parameters = (
        Parameter("friction_n", "N", 0.1, 0.0, 1e7, logarithmic=True),
        Parameter("presliding_m", "m", 0.2, 1e-10, 1.0, logarithmic=True),
    )
    confusable_with = (
        "hysteresis",
        "quadratic_damping",
    )

    def wider(self) -> tuple[WiderPresliding, float]:
        """Return the law with one more shape number, and the value of that number at which it is nearly this law."""
        return WiderPresliding((*self.parameters, SPREAD)), 0.8

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection]) for k in (0.01, 0.03, 0.08))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        steps = (np.arange(ELEMENTS) + 0.5) / ELEMENTS
        friction, presliding = self.held(values, motion)
        yields = presliding * np.exp(1.6 * (steps - 0.5))
        return JointLaw(springs=friction / ELEMENTS / yields, yields=yields)

    def held(self, values: Real, motion: JointMotion) -> Real:
        """Return the numbers that the law uses: sliding begins within a small part of the motion."""
        least, most = LEAST_PRESLIDING * motion.deflection, DRY * motion.deflection
        return np.array([values[0], np.clip(values[1], least, most)])

    def strained(self, values: Real, motion: JointMotion) -> bool:
        """Tell whether the numbers ask for so much presliding that the law is hysteresis."""
        return bool(values[1] > DRY * motion.deflection)


PHYSICS = PreslidingFriction()
