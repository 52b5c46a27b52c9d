"""Joint laws with additional shape parameters, or with a linear part."""

from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Real

from ..joints.joint_law import JointLaw, JointMotion, saturated
from .protocol import JointPhysics, Parameter

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


class WithLinearPart:
    """A joint's law ``g + k x + c v``.

    The linear part of a law cannot be told from modal parameters that are off. Where it is fitted beside the law, the
    lab's belief decides whether the modal parameters are off.

    Parameters
    ----------
    inner
        The law itself.
    motion
        Sizes of the joint's motion: k is fitted in tenths of the stiffness that the structure has there, c in tenths
        of that stiffness over the motion's typical frequency.
    """

    def __init__(self, inner: JointPhysics, motion: JointMotion) -> None:
        self.inner = inner
        self.name = inner.name
        self.equation = f"{inner.equation} + k x + c v"
        self.source = inner.source
        self.confusable_with = inner.confusable_with
        unit = 0.1 * motion.stiffness
        self.parameters: tuple[Parameter, ...] = (
            *inner.parameters,
            Parameter("linear_stiffness_n_per_m", "N/m", unit),
            Parameter("linear_damping_ns_per_m", "N s/m", unit * motion.deflection / max(motion.velocity, 1e-300)),
        )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Starting values of the law itself, with zeros for the linear part."""
        return tuple(np.append(start, [0.0, 0.0]) for start in self.inner.starts(motion))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """The joint's force law."""
        plain = self.inner.law(values[:-2], motion)
        reach = plain.reach if len(plain.stiffness) else motion.reach
        speed = plain.speed if len(plain.damping) else motion.speed
        return replace(
            plain,
            reach=reach,
            stiffness=_sloped(plain.stiffness, reach, float(values[-2])),
            speed=speed,
            damping=_sloped(plain.damping, speed, float(values[-1])),
        )


def _sloped(table: Real, reach: float, slope: float) -> Real:
    """A table over [-reach, reach] (or none) with a straight line added."""
    count = len(table) if len(table) else 3
    line = slope * np.linspace(-reach, reach, count)
    return np.asarray(table + line if len(table) else line)
