"""A joint that is softer inside a small gap than outside it."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import Parameter
from .smooth_backlash import SmoothBacklash

Real = NDArray[np.float64]


class Backlash:
    """Gears and keys with play: the flank carries only after the gap has closed."""

    name = "backlash"
    equation = "g = -k sat(x, b): stiffness k is missing inside |x| < b"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_loss_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("half_gap_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
    )
    confusable_with = (
        "stiffness_hardening",
        "stiffness_softening",
    )

    def wider(self) -> tuple[SmoothBacklash, float]:
        """Return the law with one more shape number, and the value of that number at which it is nearly this law."""
        return SmoothBacklash(), 8.0

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection]) for k in (0.15, 0.4, 0.8, 1.6))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        x = motion.deflections
        return JointLaw(reach=motion.reach, stiffness=-values[0] * np.clip(x, -values[1], values[1]))


PHYSICS = Backlash()
