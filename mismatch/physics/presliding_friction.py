"""Dry friction that gives way a little before it slides."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import DRY, Parameter
from .wider_forms import SPREAD, WiderPresliding

Real = NDArray[np.float64]

ELEMENTS = 6
"""In parallel, yields spread evenly in their logarithm, the same force each."""

LEAST_PRESLIDING = 2e-3
"""Of the typical deflection: less is friction without presliding, and as stiff as no time step can follow."""


class PreslidingFriction:
    """Asperities act as springs until they break away: sliding begins after some micrometres, not at once.

    In the limit of no presliding it is Coulomb's friction, and it is reported as that; where most of the motion is
    presliding it is :mod:`hysteresis <mismatch.physics.hysteresis>`.
    """

    name = "presliding_friction"
    answers_as = "coulomb_friction"
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
        """The law with one shape number more, and the number at which it is as this one, or nearly."""
        return WiderPresliding((*self.parameters, SPREAD)), 0.8

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Shapes to try, amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection]) for k in (0.01, 0.03, 0.08))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """The joint's force."""
        steps = (np.arange(ELEMENTS) + 0.5) / ELEMENTS
        friction, presliding = self.held(values, motion)
        yields = presliding * np.exp(1.6 * (steps - 0.5))
        return JointLaw(springs=friction / ELEMENTS / yields, yields=yields)

    def held(self, values: Real, motion: JointMotion) -> Real:
        """The numbers that the law goes by: sliding begins within a small part of the motion."""
        least, most = LEAST_PRESLIDING * motion.deflection, DRY * motion.deflection
        return np.array([values[0], np.clip(values[1], least, most)])

    def strained(self, values: Real, motion: JointMotion) -> bool:
        """Whether much presliding was asked for: hysteresis."""
        return bool(values[1] > DRY * motion.deflection)


PHYSICS = PreslidingFriction()
