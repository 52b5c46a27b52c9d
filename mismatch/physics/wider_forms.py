"""Laws with one more shape number than the library's: they show how far a number depends on the form of its law."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion, saturated
from .protocol import Parameter

Real = NDArray[np.float64]

ELEMENTS = 10
"""Number of elements of a slider law with free spread."""


@dataclass(frozen=True)
class WiderFriction:
    """Friction over velocity whose saturation has a free sharpness.

    A sharpness of 2 gives ``s / sqrt(1 + s^2)``; about 2.6 comes close to the hyperbolic tangent, 1 to the arctangent.
    """

    parameters: tuple[Parameter, ...]
    name: str = "wider_friction"
    equation: str = "g = F_c s / (1 + |s|^n)^(1/n), s = v / v0"
    source: str = "Armstrong-Helouvry, Dupont & Canudas de Wit 1994, Automatica 30"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return one start near the hyperbolic tangent, with the amplitude 1."""
        return (np.array([1.0, 0.05 * motion.velocity, 2.0]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        smooth = max(values[1], 4e-4 * motion.speed)
        return JointLaw(
            speed=motion.speed, damping=values[0] / smooth * saturated(motion.velocities, smooth, values[2])
        )


@dataclass(frozen=True)
class WiderPresliding:
    """Sliders in parallel whose yields have a free spread; together they slide at the force F_c."""

    parameters: tuple[Parameter, ...]
    name: str = "wider_presliding"
    equation: str = "g = F_c p(x), elastic-plastic elements of equal force whose yields spread in their logarithm"
    source: str = "Iwan 1966, J. Applied Mechanics 33"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return one start at the library's spread, with the amplitude 1."""
        return (np.array([1.0, 0.05 * motion.deflection, 0.8]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        steps = (np.arange(ELEMENTS) + 0.5) / ELEMENTS
        yields = max(values[1], 1e-3 * motion.deflection) * np.exp(2 * values[2] * (steps - 0.5))
        return JointLaw(springs=values[0] / ELEMENTS / yields, yields=yields)


@dataclass(frozen=True)
class WiderDamping:
    """Damping that is proportional to any power of the velocity."""

    parameters: tuple[Parameter, ...]
    name: str = "wider_damping"
    equation: str = "g = c |v|^n sign v, c at v0 as of the square"
    source: str = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return one start at the square of the velocity, with the amplitude 1."""
        return (np.array([1.0, 2.0]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force; the power is taken of the velocity over its typical value."""
        v, typical = motion.velocities, motion.velocity
        return JointLaw(
            speed=motion.speed,
            damping=values[0] * typical**2 * np.sign(v) * (np.abs(v) / typical) ** values[1],
        )


SHARPNESS = Parameter("sharpness", "", 0.3, 0.7, 12.0)
SPREAD = Parameter("spread", "", 0.2, 0.05, 3.0)
POWER = Parameter("power", "", 0.1, 0.6, 4.0)
