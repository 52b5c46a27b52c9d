"""Play with soft corners: flanks that bend, bearings whose rollers take up load one after the other."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion, saturated
from .protocol import Parameter

Real = NDArray[np.float64]


class SmoothBacklash:
    """Backlash whose gap closes little by little; sharp corners are :mod:`backlash <mismatch.physics.backlash>`.

    It differs from :mod:`saturating hardening <mismatch.physics.saturating_hardening>` by a linear spring alone:
    the law that asks for the less odd modes is taken, and both are reported where the modes do not decide.
    """

    name = "smooth_backlash"
    answers_as = "backlash"
    twin = "saturating_hardening"
    equation = "g = -k x / (1 + |x / b|^n)^(1/n): stiffness k is missing inside about |x| < b"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_loss_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("half_gap_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("sharpness", "", 0.3, 1.0, 12.0),
    )
    confusable_with = (
        "stiffness_hardening",
        "stiffness_softening",
    )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection, 2.0]) for k in (0.3, 0.6, 1.2))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        kept = saturated(motion.deflections, values[1], values[2])
        return JointLaw(reach=motion.reach, stiffness=-values[0] * kept)


PHYSICS = SmoothBacklash()
