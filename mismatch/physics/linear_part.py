"""A joint's law with a linear spring and damper beside it: what a drifted or shifted operating point leaves."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import JointPhysics, Parameter

Real = NDArray[np.float64]


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
