"""Laws with one shape number more than the library's: they show what a number owes to the form of its law."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion, saturated
from .protocol import Parameter

Real = NDArray[np.float64]

ELEMENTS = 10
"""Of a slider law with free spread."""


@dataclass(frozen=True)
class WiderFriction:
    """Friction over velocity that saturates as slowly as a free sharpness says.

    Sharpness 2 is the square root's, about 2.6 comes close to the hyperbolic tangent, 1 to the arctangent.
    """

    parameters: tuple[Parameter, ...]
    name: str = "wider_friction"
    equation: str = "g = F_c s / (1 + |s|^n)^(1/n), s = v / v0"
    source: str = "Armstrong-Helouvry, Dupont & Canudas de Wit 1994, Automatica 30"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Beside the hyperbolic tangent."""
        return (np.array([1.0, 0.05 * motion.velocity, 2.0]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """The joint's force."""
        smooth = max(values[1], 4e-4 * motion.speed)
        return JointLaw(
            speed=motion.speed, damping=values[0] / smooth * saturated(motion.velocities, smooth, values[2])
        )


@dataclass(frozen=True)
class WiderPresliding:
    """Sliders in parallel whose yields spread as widely as a free number says; together they slide at F_c."""

    parameters: tuple[Parameter, ...]
    name: str = "wider_presliding"
    equation: str = "g = F_c p(x), elastic-plastic elements of equal force whose yields spread in their logarithm"
    source: str = "Iwan 1966, J. Applied Mechanics 33"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Beside the library's spread."""
        return (np.array([1.0, 0.05 * motion.deflection, 0.8]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """The joint's force."""
        steps = (np.arange(ELEMENTS) + 0.5) / ELEMENTS
        yields = max(values[1], 1e-3 * motion.deflection) * np.exp(2 * values[2] * (steps - 0.5))
        return JointLaw(springs=values[0] / ELEMENTS / yields, yields=yields)


@dataclass(frozen=True)
class WiderDamping:
    """Damping that goes with any power of the velocity."""

    parameters: tuple[Parameter, ...]
    name: str = "wider_damping"
    equation: str = "g = c |v|^n sign v, c at v0 as of the square"
    source: str = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    confusable_with: tuple[str, ...] = ()

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Beside the square."""
        return (np.array([1.0, 2.0]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """The joint's force; the power is taken about the typical velocity."""
        v, typical = motion.velocities, motion.velocity
        return JointLaw(
            speed=motion.speed,
            damping=values[0] * typical**2 * np.sign(v) * (np.abs(v) / typical) ** values[1],
        )


SHARPNESS = Parameter("sharpness", "", 0.3, 0.7, 12.0)
SPREAD = Parameter("spread", "", 0.2, 0.05, 3.0)
POWER = Parameter("power", "", 0.1, 0.6, 4.0)
