"""A joint that gets stiffer as it deflects."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import Parameter

Real = NDArray[np.float64]


class StiffnessHardening:
    """Contacts that close, a harmonic drive under torque: the restoring force grows faster than the deflection."""

    name = "stiffness_hardening"
    equation = "g = k3 |x|^(n-1) x, n from 2 to 5"
    source = "Duffing 1918; Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("force_at_1mm_n", "N", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("exponent", "", 0.2, 1.5, 6.0),
    )
    confusable_with = (
        "stiffness_softening",
        "backlash",
    )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, n]) for n in (2.0, 3.0, 4.5))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        x = motion.deflections
        return JointLaw(reach=motion.reach, stiffness=values[0] * np.sign(x) * (np.abs(x) / 1e-3) ** values[1])


PHYSICS = StiffnessHardening()
