"""Joint laws of stiffness: hardening, softening, play, drift."""

import numpy as np
import scipy

from millfrf.core import Real

from ..joints.joint_law import JointLaw, JointMotion, saturated
from .protocol import Parameter


class SmoothBacklash:
    """Backlash whose gap closes little by little; sharp corners are :mod:`backlash
    <millfrf.mismatch.physics.joint_stiffness>`.

    It differs from :mod:`saturating hardening <millfrf.mismatch.physics.joint_stiffness>` by a linear spring alone:
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


SMOOTH_BACKLASH = SmoothBacklash()


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


BACKLASH = Backlash()


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
        >>> [round(float(one), 3) for one in POSE_DRIFT.other_course(np.array([1.0, 0.0, -0.25]))]
        [1.069, 0.0, -0.25]
        """
        change, bend = abs(float(values[0])), abs(float(values[2]))
        shape = min(bend / change, _bend_of(FASTEST)) if change else 0.0
        if shape <= _bend_of(1e-2):
            return values
        rate = float(scipy.optimize.brentq(lambda a: _bend_of(a) - shape, 1e-3, FASTEST + 1e-6))
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


POSE_DRIFT = PoseDrift()


class SaturatingHardening:
    """Hardening that ends: one stiffness at small deflections turns into another at large ones.

    It differs from :mod:`smooth backlash <millfrf.mismatch.physics.joint_stiffness>` by a linear spring alone: here the
    nominal model holds at small deflections, there it holds at large ones. The law that asks for the less odd modes
    is taken.
    """

    name = "saturating_hardening"
    answers_as = "stiffness_hardening"
    twin = "smooth_backlash"
    equation = "g = k (x - x / (1 + |x / x0|^n)^(1/n)): stiffness k is gained beyond the knee x0"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_gain_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("knee_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("sharpness", "", 0.3, 1.0, 12.0),
    )
    confusable_with = (
        "backlash",
        "stiffness_softening",
    )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection, 2.0]) for k in (0.5, 1.0, 2.0))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        x = motion.deflections
        return JointLaw(reach=motion.reach, stiffness=values[0] * (x - saturated(x, values[1], values[2])))


SATURATING_HARDENING = SaturatingHardening()


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


STIFFNESS_HARDENING = StiffnessHardening()


class StiffnessSoftening:
    """Contact that opens, preload lost, a drive that yields: part of the stiffness saturates beyond a knee."""

    name = "stiffness_softening"
    equation = "g = k (x / (1 + |x / x0|^n)^(1/n) - x): stiffness k is lost beyond the knee x0"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_loss_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("knee_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("sharpness", "", 0.3, 1.0, 12.0),
    )
    confusable_with = (
        "stiffness_hardening",
        "backlash",
        "hysteresis",
    )

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return the numbers from which fits start: one set a shape, each with the amplitude 1."""
        return tuple(np.array([1.0, k * motion.deflection, n]) for k in (0.5, 1.0, 2.0, 4.0) for n in (2.0,))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        """Return the law of the joint's force at these numbers."""
        x = motion.deflections
        return JointLaw(reach=motion.reach, stiffness=values[0] * (saturated(x, values[1], values[2]) - x))


STIFFNESS_SOFTENING = StiffnessSoftening()
