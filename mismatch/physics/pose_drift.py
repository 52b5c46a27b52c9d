"""A joint whose stiffness changes steadily during the cut: evenly, or faster at its beginning or its end."""

import numpy as np
from numpy.typing import NDArray

from ..joints import JointLaw, JointMotion
from .protocol import Parameter

Real = NDArray[np.float64]


SCALE = 1e3
"""Step of the stiffness that is noticeable in a fit, N/m."""


class PoseDrift:
    """The robot moves along its path, or warms up: one joint softens or stiffens from beginning to end."""

    name = "pose_drift"
    equation = "g = (r (t / T - n) + b (4 (t / T - 1/2)^2 - 1)) x"
    source = "Verboven et al. 2004 on slowly varying structures; linear time-varying stiffness"
    parameters = (
        Parameter("stiffness_change_n_per_m", "N/m", SCALE, -1e12, 1e12),
        Parameter("nominal_at", "share of the recording", 0.1, -5.0, 5.0),
        Parameter("bend_n_per_m", "N/m", SCALE, -1e12, 1e12),
    )
    confusable_with = ("stiffness_softening",)

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return two starts with the amplitude 1: the nominal model holds at a recording's beginning, or at its end."""
        return (np.array([1.0, 0.0, 0.0]), np.array([1.0, 1.0, 0.0]))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        lasting = values[0] * (0.5 - values[1])
        return JointLaw(
            reach=motion.reach,
            stiffness=lasting * np.linspace(-motion.reach, motion.reach, 3),
            ramp=values[0],
            bend=values[2],
        )


PHYSICS = PoseDrift()
