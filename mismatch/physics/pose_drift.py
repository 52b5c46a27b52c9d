"""A joint whose stiffness changes steadily during the cut: evenly, or faster at its beginning or its end."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from ..joints import JointLaw, JointMotion
from .protocol import Parameter

Real = NDArray[np.float64]


SCALE = 1e3
"""Step of the stiffness that is noticeable in a fit, N/m."""

FASTEST = 20.0
"""Rate of an exponential course, over the recording's length, above which it is a jump at the beginning."""


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

    def other_course(self, values: Real) -> Real:
        """Return the numbers of an exponential course whose best parabola has this bend over its change.

        What warms up or settles follows ``(1 - exp(-a t / T)) / (1 - exp(-a))`` or its mirror image. A parabola follows
        its middle, and changes less from beginning to end: by 12 % for a = 3.

        Parameters
        ----------
        values : (3,)
            Change from beginning to end, N/m; time at which the nominal model holds, as a share of the recording; bend,
            N/m.

        Returns
        -------
        (3,)
            The same numbers with the change of the exponential course, N/m.

        Examples
        --------
        >>> [round(float(one), 3) for one in PHYSICS.other_course(np.array([1.0, 0.0, -0.25]))]
        [1.069, 0.0, -0.25]
        """
        change, bend = abs(float(values[0])), abs(float(values[2]))
        shape = min(bend / change, _bend_of(FASTEST)) if change else 0.0
        if shape <= _bend_of(1e-2):
            return values
        rate = float(brentq(lambda a: _bend_of(a) - shape, 1e-3, FASTEST + 1e-6))
        return np.append(values[0] / _projected(rate)[0], values[1:])


def _projected(rate: float) -> tuple[float, float]:
    """Change from beginning to end, and bend, of the best parabola through an exponential course from 0 to 1."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    course = -np.expm1(-rate * (nodes + 1) / 2) / -np.expm1(-rate)
    even, curved = (1.5 * weights @ (course * nodes), 2.5 * weights @ (course * (3 * nodes**2 - 1) / 2))
    return float(2 * even), float(-1.5 * curved)


def _bend_of(rate: float) -> float:
    """Bend over change of the best parabola through an exponential course."""
    change, bend = _projected(rate)
    return bend / change


PHYSICS = PoseDrift()
