"""Joint laws of the library: friction, damping, hardening, softening, play and drift."""

import numpy as np
import scipy

from millfrf.core import Real

from ..joints.joint_law import JointLaw, JointMotion, saturated
from .protocol import DRY, Parameter
from .wider_forms import POWER, SHARPNESS, SPREAD, WiderDamping, WiderFriction, WiderPresliding, spread_yields

ELEMENTS = 6  # elastic-plastic elements in parallel


class CoulombFriction:
    """Coulomb friction: a force of constant size against the velocity, smooth around zero velocity."""

    name = "coulomb_friction"
    beyond = "quadratic_damping"
    preloaded = True
    equation = "g = F_c tanh(v / v0)"
    source = "Coulomb 1785; Armstrong-Helouvry, Dupont & Canudas de Wit 1994, Automatica 30"
    parameters = (
        Parameter("friction_n", "N", 0.1, 0.0, 1e7, logarithmic=True),
        Parameter("smooth_velocity_m_per_s", "m/s", 0.3, 1e-9, 10.0, logarithmic=True),
    )
    confusable_with = ("hysteresis", "quadratic_damping")

    def wider(self) -> tuple[WiderFriction, float]:
        """Return the law with one more shape number, and the value of that number at which it is almost this law."""
        return WiderFriction((*self.parameters, SHARPNESS)), 2.6

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.array([1.0, k * motion.velocity]) for k in (0.01, 0.03, 0.08))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        friction, smooth = self.limited(values, motion)
        return JointLaw(speed=motion.speed, damping=friction * np.tanh(motion.velocities / smooth))

    def limited(self, values: Real, motion: JointMotion) -> Real:
        # the lower limit is about four points of the table
        return np.array([values[0], np.clip(values[1], 4e-4 * motion.speed, DRY * motion.velocity)])

    def beyond_limits(self, values: Real, motion: JointMotion) -> bool:
        """Return whether the force still rises at high speed, as a damping force does."""
        return bool(values[1] > DRY * motion.velocity)


COULOMB_FRICTION = CoulombFriction()


class PreslidingFriction:
    """Friction with presliding: contacts act as springs, and sliding begins after some micrometres.

    Without presliding the law is Coulomb's friction, under whose name it is reported. If most of the motion is
    presliding, the law is hysteresis.
    """

    name = "presliding_friction"
    reported_as = "coulomb_friction"
    beyond = "hysteresis"
    preloaded = True
    equation = "g = F_c p(x): a force that follows the deflection since the last turn, and slides at F_c"
    source = "Dahl 1968, Aerospace Corp. TOR-0158; Canudas de Wit, Olsson, Astrom & Lischinsky 1995, IEEE TAC 40"
    parameters = (
        Parameter("friction_n", "N", 0.1, 0.0, 1e7, logarithmic=True),
        Parameter("presliding_m", "m", 0.2, 1e-10, 1.0, logarithmic=True),
    )
    confusable_with = ("hysteresis", "quadratic_damping")

    def wider(self) -> tuple[WiderPresliding, float]:
        """Return the law with one more shape number, and the value of that number at which it is almost this law."""
        return WiderPresliding((*self.parameters, SPREAD)), 0.8

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.array([1.0, k * motion.deflection]) for k in (0.01, 0.03, 0.08))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        friction, presliding = self.limited(values, motion)
        yields = spread_yields(presliding, 1.6, ELEMENTS)
        return JointLaw(springs=friction / ELEMENTS / yields, yields=yields)

    def limited(self, values: Real, motion: JointMotion) -> Real:
        # with less presliding the law is too stiff for any time step
        least, most = 2e-3 * motion.deflection, DRY * motion.deflection
        return np.array([values[0], np.clip(values[1], least, most)])

    def beyond_limits(self, values: Real, motion: JointMotion) -> bool:
        """Return whether there is so much presliding that the law is hysteresis."""
        return bool(values[1] > DRY * motion.deflection)


PRESLIDING_FRICTION = PreslidingFriction()


class Hysteresis:
    """Microslip: bolts, gears and bearings stick, slip little by little, and remember where they turned."""

    name = "hysteresis"
    beyond = "coulomb_friction"
    equation = "g = sum_i k_i p_i(x), elastic-plastic elements with yields spread around one"
    source = "Iwan 1966, J. Applied Mechanics 33; Bouc 1967, Wen 1976"
    parameters = (
        Parameter("stiffness_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("yield_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("spread", "", 0.2, 0.05, 3.0),
    )
    confusable_with = ("coulomb_friction", "stiffness_softening")

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.array([1.0, k * motion.deflection, 0.8]) for k in (0.15, 0.3, 1.0, 2.5))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        stiffness, typical, spread = self.limited(values, motion)
        yields = spread_yields(typical, spread * 2, ELEMENTS)
        return JointLaw(springs=np.full(ELEMENTS, stiffness / ELEMENTS), yields=yields)

    def limited(self, values: Real, motion: JointMotion) -> Real:
        return np.array([values[0], max(values[1], DRY * motion.deflection), values[2]])

    def beyond_limits(self, values: Real, motion: JointMotion) -> bool:
        """Return whether the elements yield almost immediately, as with dry friction."""
        return bool(values[1] < DRY * motion.deflection)


HYSTERESIS = Hysteresis()


class QuadraticDamping:
    """Lubricant, air or hydraulic balancing: the force is proportional to v |v|."""

    name = "quadratic_damping"
    equation = "g = c2 |v| v"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (Parameter("damping_ns2_per_m2", "N s^2/m^2", 0.1, 0.0, 1e12, logarithmic=True),)
    confusable_with = ("coulomb_friction",)

    def wider(self) -> tuple[WiderDamping, float]:
        """Return the law with one more shape number, and the value of that number at which it is almost this law."""
        return WiderDamping((*self.parameters, POWER)), 2.0

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return (np.array([1.0]),)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        v = motion.velocities
        return JointLaw(speed=motion.speed, damping=values[0] * np.abs(v) * v)


QUADRATIC_DAMPING = QuadraticDamping()


class SmoothBacklash:
    """Backlash whose gap closes gradually; `Backlash` has sharp corners.

    It differs from `SaturatingHardening` only by a linear spring: the law with the more plausible modes is chosen, and
    both are reported if the modes do not decide.
    """

    name = "smooth_backlash"
    reported_as = "backlash"
    twin = "saturating_hardening"
    equation = "g = -k x / (1 + |x / b|^n)^(1/n): stiffness k is missing inside about |x| < b"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_loss_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("half_gap_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("sharpness", "", 0.3, 1.0, 12.0),
    )
    confusable_with = ("stiffness_hardening", "stiffness_softening")

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.array([1.0, k * motion.deflection, 2.0]) for k in (0.3, 0.6, 1.2))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        lost = saturated(motion.deflections, values[1], values[2])
        return JointLaw(reach=motion.reach, stiffness=-values[0] * lost)


SMOOTH_BACKLASH = SmoothBacklash()


class Backlash:
    """Gears and keys with play: the flank carries load only after the gap has closed."""

    name = "backlash"
    equation = "g = -k sat(x, b): stiffness k is missing inside |x| < b"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_loss_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("half_gap_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
    )
    confusable_with = ("stiffness_hardening", "stiffness_softening")

    def wider(self) -> tuple[SmoothBacklash, float]:
        """Return the law with one more shape number, and the value of that number at which it is almost this law."""
        return SmoothBacklash(), 8.0

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.array([1.0, k * motion.deflection]) for k in (0.15, 0.4, 0.8, 1.6))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        x = motion.deflections
        return JointLaw(reach=motion.reach, stiffness=-values[0] * np.clip(x, -values[1], values[1]))


BACKLASH = Backlash()


class PoseDrift:
    """The robot moves along its path, or warms up: one joint softens or stiffens from start to end."""

    name = "pose_drift"
    equation = "g = (r (t / T - n) + b (4 (t / T - 1/2)^2 - 1)) x"
    source = "Verboven et al. 2004 on slowly varying structures; linear time-varying stiffness"
    parameters = (
        Parameter("stiffness_change_n_per_m", "N/m", 1e3, -1e12, 1e12),
        Parameter("nominal_at", "share of the recording", 0.1, -5.0, 5.0),
        Parameter("bend_n_per_m", "N/m", 1e3, -1e12, 1e12),
    )
    confusable_with = ("stiffness_softening",)

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return two starts with the amplitude 1: the nominal model holds at a recording's start, or at its end."""
        return (np.array([1.0, 0.0, 0.0]), np.array([1.0, 1.0, 0.0]))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        mean = values[0] * (0.5 - values[1])
        return JointLaw(
            reach=motion.reach,
            stiffness=mean * np.linspace(-motion.reach, motion.reach, 3),
            ramp=values[0],
            bend=values[2],
        )

    def other_course(self, values: Real) -> Real:
        """Return the numbers of the exponential course whose best parabola has the same ratio of bend to change.

        A stiffness that changes by warming up or settling follows ``(1 - exp(-a t / T)) / (1 - exp(-a))`` or the mirror
        image. The best parabola for this course changes less from start to end, by 12 % for a = 3. In the result, only
        the first of the numbers ``values``, the change, is different.
        """
        fastest = 20.0  # rate a above which the course is a jump at the start
        change, bend = abs(float(values[0])), abs(float(values[2]))
        shape = min(bend / change, _bend_ratio(fastest)) if change else 0.0
        if shape <= _bend_ratio(1e-2):
            return values
        rate = float(scipy.optimize.brentq(lambda a: _bend_ratio(a) - shape, 1e-3, fastest + 1e-6))
        return np.append(values[0] / _best_parabola(rate)[0], values[1:])


def _best_parabola(rate: float) -> tuple[float, float]:
    """Return the change from start to end and the bend of the parabola that fits an exponential course best."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    course = -np.expm1(-rate * (nodes + 1) / 2) / -np.expm1(-rate)
    # projections on the Legendre polynomials of order 1 and 2
    linear, quadratic = (1.5 * weights @ (course * nodes), 2.5 * weights @ (course * (3 * nodes**2 - 1) / 2))
    return float(2 * linear), float(-1.5 * quadratic)


def _bend_ratio(rate: float) -> float:
    change, bend = _best_parabola(rate)
    return bend / change


POSE_DRIFT = PoseDrift()


UNKNOWN_LINE = (0.0, 1.0)  # Hz: ends of a sweep where a motion states none


class SpeedStiffness:
    """The stiffness of one joint follows the spindle speed, as that of bearings does.

    The speed shows as the line of the force that sweeps, such as the passing of the teeth.
    """

    name = "speed_stiffness"
    equation = "g = k' (f(t) - f0) x, f the frequency of the force's line that sweeps"
    source = "Cao & Altintas 2004, J. Mechanical Design 126: stiffness of spindle bearings over the speed"
    parameters = (
        Parameter("stiffness_per_hz_ns_per_m", "N s/m", 50.0, -1e12, 1e12),
        Parameter("nominal_at_hz", "Hz", 2.0, -1e5, 1e5),
    )
    confusable_with = ("pose_drift",)

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        """Return two starts with the amplitude 1: the nominal model holds at the lowest or at the highest speed."""
        return tuple(np.array([1.0, frequency]) for frequency in motion.swept_line or UNKNOWN_LINE)

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        start, end = motion.swept_line or UNKNOWN_LINE
        middle = values[0] * (0.5 * (start + end) - values[1])
        return JointLaw(
            reach=motion.reach,
            stiffness=middle * np.linspace(-motion.reach, motion.reach, 3),
            ramp=values[0] * (end - start),
        )


SPEED_STIFFNESS = SpeedStiffness()


class SaturatingHardening:
    """Hardening with a limit: the stiffness changes from one value at small deflections to a larger one beyond a knee.

    It differs from `SmoothBacklash` only by a linear spring: with hardening the nominal model is valid at small
    deflections, with backlash at large ones. The law with the more plausible modes is chosen.
    """

    name = "saturating_hardening"
    reported_as = "stiffness_hardening"
    twin = "smooth_backlash"
    equation = "g = k (x - x / (1 + |x / x0|^n)^(1/n)): stiffness k is gained beyond the knee x0"
    source = "Worden & Tomlinson, Nonlinearity in Structural Dynamics, section 2.2"
    parameters = (
        Parameter("stiffness_gain_n_per_m", "N/m", 0.1, 0.0, 1e12, logarithmic=True),
        Parameter("knee_m", "m", 0.1, 1e-9, 1.0, logarithmic=True),
        Parameter("sharpness", "", 0.3, 1.0, 12.0),
    )
    confusable_with = ("backlash", "stiffness_softening")

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.array([1.0, k * motion.deflection, 2.0]) for k in (0.5, 1.0, 2.0))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
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
    confusable_with = ("stiffness_softening", "backlash")

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.array([1.0, n]) for n in (2.0, 3.0, 4.5))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
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
    confusable_with = ("stiffness_hardening", "backlash", "hysteresis")

    def starts(self, motion: JointMotion) -> tuple[Real, ...]:
        return tuple(np.array([1.0, k * motion.deflection, 2.0]) for k in (0.5, 1.0, 2.0, 4.0))

    def law(self, values: Real, motion: JointMotion) -> JointLaw:
        x = motion.deflections
        return JointLaw(reach=motion.reach, stiffness=values[0] * (saturated(x, values[1], values[2]) - x))


STIFFNESS_SOFTENING = StiffnessSoftening()
