"""Joint laws of friction and damping."""

import numpy as np

from millfrf.core import Real

from ..joints.joint_law import JointLaw, JointMotion
from .protocol import DRY, Parameter
from .wider_forms import POWER, SHARPNESS, SPREAD, WiderDamping, WiderFriction, WiderPresliding


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


COULOMB_FRICTION = CoulombFriction()

ELEMENTS = 6
"""Number of elements in parallel, of equal force; their yields are spread evenly in the logarithm."""

LEAST_PRESLIDING = 2e-3
"""Least presliding as a share of the typical deflection: less is friction without presliding, too stiff for any time
step."""


class PreslidingFriction:
    """Asperities act as springs until they break away: sliding begins after some micrometres, not at once.

    Without presliding it becomes Coulomb's friction, and it is reported under that name; where most of the motion is
    presliding it becomes :mod:`hysteresis <millfrf.mismatch.physics.joint_friction>`.
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


PRESLIDING_FRICTION = PreslidingFriction()
"""Number of elements in parallel; their yields are spread evenly in the logarithm."""


class Hysteresis:
    """Microslip: bolts, gears and bearings stick, slip little by little and remember where they turned."""

    name = "hysteresis"
    beyond = "coulomb_friction"
    equation = "g = sum_i k_i p_i(x), elastic-plastic elements with yields spread around one"
    source = "Iwan 1966, J. Applied Mechanics 33; Bouc 1967, Wen 1976"
    parameters = (
        Parameter("stiffness_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("yield_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("spread", "", 0.2, 0.05, 3.0),
    )
    confusable_with = (
        "coulomb_friction",
        "stiffness_softening",
    )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection, 0.8]) for k in (0.15, 0.3, 1.0, 2.5))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        steps = (np.arange(ELEMENTS) + 0.5) / ELEMENTS
        stiffness, typical, spread = self.held(values, motion)
        yields = typical * np.exp(spread * 2 * (steps - 0.5))
        return JointLaw(springs=np.full(ELEMENTS, stiffness / ELEMENTS), yields=yields)

    def held(self, values: Real, motion: JointMotion) -> Real:
        """Return the numbers that the law uses: an element that yields within less of the motion is dry friction."""
        return np.array([values[0], max(values[1], DRY * motion.deflection), values[2]])

    def strained(self, values: Real, motion: JointMotion) -> bool:
        """Tell whether the numbers ask for elements that yield almost at once, which is dry friction."""
        return bool(values[1] < DRY * motion.deflection)


HYSTERESIS = Hysteresis()


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


QUADRATIC_DAMPING = QuadraticDamping()
