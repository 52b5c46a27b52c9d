"""Linear causes in the structure and the measuring chain, from missing modes to resonances of transducers."""

from itertools import permutations

import numpy as np
import scipy

from millfrf.core import Complex, Real
from modal_fit import ModalModel

from .protocol import Chain, ChainPhysics, Parameter, axes_of, resonance_of


class GyroscopicCoupling(ChainPhysics):
    """The angular momentum of spindle or tool couples motions across its axis."""

    name = "gyroscopic_coupling"
    equation = "F = F_outer - [n]x X', [n]x antisymmetric"
    source = "Meirovitch, Fundamentals of Vibrations, section 4.7"
    parameters = (
        Parameter("coupling_x_ns_per_m", "N s/m", 20.0),
        Parameter("coupling_y_ns_per_m", "N s/m", 20.0),
        Parameter("coupling_z_ns_per_m", "N s/m", 20.0),
    )
    acts_on_motion = True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the columns and rows that are X, Y, Z; none without both triads."""
        triads = triad(model.excitations), triad(model.responses)
        return ("|".join(triads),) if all(triads) else ()

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        columns, rows = ([int(text) for text in side.split()] for side in place.split("|"))
        x, y, z = values
        cross = np.zeros((len(model.excitations), len(model.responses)))
        cross[np.ix_(columns, rows)] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
        return Chain(feedback=s[:, None, None] * cross)


def triad(labels: tuple[str, ...]) -> str:
    """Return the places of X, Y and Z among degrees of freedom; empty unless each is there once."""
    axes = axes_of(labels)
    if any(axes.count(axis) != 1 for axis in "XYZ"):
        return ""
    return " ".join(str(axes.index(axis)) for axis in "XYZ")


GYROSCOPIC_COUPLING = GyroscopicCoupling()

# Damping ratio above which a pole gives no peak, so that a different force can imitate it: three times the largest
# damping ratio of a milling robot in the source papers (0.0996; Mohammadi & Ahmadi, Table 1).
MOST_DAMPED = 0.3


class MissingMode:
    """A resonance that the modal test missed, or that a part mounted since has added.

    Its numbers are fitted together with the numbers of the model's modes.
    """

    name = "missing_mode"
    equation = "H += r l^T / (s - p) + conjugate"
    source = "Ewins, Modal Testing, 2nd ed., section 4.4"
    parameters: tuple[Parameter, ...] = ()
    confusable_with = ("unmeasured_excitation", "modal_parameters")

    def overdamped(self, pole: complex) -> str:
        """Return why a pole (rad/s, positive imaginary part) is no mode; an empty text if it may be a mode.

        >>> MISSING_MODE.overdamped(-12.0 + 100.0j), MISSING_MODE.overdamped(-100.0 + 100.0j)
        ('', 'a mode damped by 71 % is no resonance')
        """
        ratio = -pole.real / abs(pole)
        return f"a mode damped by {100 * ratio:.0f} % is no resonance" if ratio > MOST_DAMPED else ""

    def resolved(self, pole: complex, spacing: float, least: float) -> bool:
        """Return whether a mode's half-power bandwidth is wider than ``least`` times the line ``spacing``, Hz.

        A narrower peak is a tone, or due to chance.
        """
        return float(-pole.real / np.pi) > least * spacing


MISSING_MODE = MissingMode()


class ModalParameters:
    """Modal parameters that deviate from the nominal model by more than a laboratory's errors.

    The structure has changed since its modal test, or the test was wrong.
    """

    name = "modal_parameters"
    equation = "H(u), |u|^2 > n + 4 sqrt(2 n)"
    source = "Balmes, GARTEUR group on ground vibration testing, IMAC XV, 1997 (scatter between 12 laboratories)"
    parameters: tuple[Parameter, ...] = ()
    confusable_with = ("gain_error", "axis_misalignment", "missing_mode")

    def implausible(self, deviation: float, count: int) -> bool:
        """Return whether the deviation ``|u|^2`` of ``count`` numbers is implausible for errors of the usual size.

        For usual errors of n numbers, the deviation has the mean n and the variance 2 n. The limit is four standard
        deviations above the mean.
        """
        return bool(deviation >= count + 4 * np.sqrt(2 * count))


MODAL_PARAMETERS = ModalParameters()

PLACES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))  # rows and columns of the six numbers of a symmetric matrix


class NonProportionalDamping(ChainPhysics):
    """Damping of the tool's motion by joints or the cut: a symmetric matrix that modal damping cannot describe."""

    name = "non_proportional_damping"
    equation = "F = F_outer - C X', C = C^T"
    source = "Caughey & O'Kelly, J. Applied Mechanics 32, 1965; Meirovitch, Fundamentals of Vibrations, section 7.15"
    parameters = tuple(Parameter(f"damping_{'xyz'[i]}{'xyz'[j]}_ns_per_m", "N s/m", 20.0, -1e6, 1e6) for i, j in PLACES)
    acts_on_motion = True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place if forces and responses are X, Y and Z, each once."""
        sides = model.excitations, model.responses
        return ("",) if all(sorted(axes_of(labels)) == ["X", "Y", "Z"] for labels in sides) else ()

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        sides = model.excitations, model.responses
        columns, rows = (["XYZ".index(axis) for axis in axes_of(labels)] for labels in sides)
        return Chain(feedback=s[:, None, None] * _matrix(values)[np.ix_(columns, rows)])

    def impossible(self, values: Real, margin: Real) -> str:
        """Return a reason if ``d^T C d`` is clearly negative along a direction d, as a damper cannot supply energy."""
        lowest, directions = np.linalg.eigh(_matrix(values))
        d = directions[:, 0]
        weights = np.array([d[i] * d[j] * (1 if i == j else 2) for i, j in PLACES])
        if lowest[0] >= -float(np.linalg.norm(weights * margin)):
            return ""
        return (
            f"a damper that gives energy ({lowest[0]:.3g} N s/m along one direction); less damping than the model's is "
            "a matter of its modes"
        )


def _matrix(values: Real) -> Real:
    """Return the symmetric matrix C, (3, 3), of its six numbers."""
    damping = np.zeros((3, 3))
    for value, (i, j) in zip(values, PLACES, strict=True):
        damping[i, j] = damping[j, i] = value
    return damping


NON_PROPORTIONAL_DAMPING = NonProportionalDamping()

TWO_STAGES = "two stages"


class AcCoupling(ChainPhysics):
    """An IEPE sensor or an amplifier with too high a corner frequency."""

    name = "ac_coupling"
    equation = "C(s) = (s / (s + 2 pi f_c))^n, n = 1 or 2 stages"
    source = "Ewins, Modal Testing, 2nd ed., section 3.5"
    parameters = (Parameter("corner_hz", "Hz", 0.05, 1e-3, 50.0, logarithmic=True),)
    confusable_with = ("channel_delay",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the whole measuring chain, with one stage (sensor or amplifier) or two (both)."""
        return ("", TWO_STAGES)

    def start(self, model: ModalModel) -> Real:
        """Return a corner frequency so low that the high-pass is nearly absent, Hz."""
        return np.array([0.05])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        gain = (s / (s + 2 * np.pi * values[0])) ** (2 if place == TWO_STAGES else 1)
        return Chain(response=gain[:, None, None] * np.eye(len(model.responses)))

    def other_forms(self, values: Real, place: str) -> tuple[tuple[str, Real], ...]:
        """Return the other number of stages, with the corner that gives the same phase ``n f_c / f`` well above it."""
        return (("", 2 * values),) if place == TWO_STAGES else ((TWO_STAGES, values / 2),)


AC_COUPLING = AcCoupling()


class ForceMatrix(ChainPhysics):
    """A constant matrix between the true and the measured forces along X, Y and Z."""

    drives: tuple[str, ...] = ("force", "moment")

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the three columns that are X, Y, Z; none without such a triad."""
        return (columns,) if (columns := triad(model.excitations)) else ()

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        columns = [int(text) for text in place.split()]
        true = np.eye(len(model.excitations))
        true[np.ix_(columns, columns)] = self.true_forces(values)
        return Chain(force=np.tile(true.astype(complex), (len(s), 1, 1)))

    def true_forces(self, values: Real) -> Real:
        """Return the matrix from measured to true forces along X, Y and Z, (3, 3)."""
        raise NotImplementedError


class AxisMisalignment(ForceMatrix):
    """The dynamometer stands askew on the table, or the accelerometer on the housing."""

    name = "axis_misalignment"
    equation = "F = R(r) F_measured, R the rotation by the vector r"
    source = "Rodrigues 1840; Goldstein, Classical Mechanics, section 4.7"
    parameters = (
        Parameter("rotation_x_rad", "rad", 0.01, -1.0, 1.0),
        Parameter("rotation_y_rad", "rad", 0.01, -1.0, 1.0),
        Parameter("rotation_z_rad", "rad", 0.01, -1.0, 1.0),
    )
    drives = ("force", "moment", "acceleration")
    confusable_with = ("modal_parameters", "gain_error")

    def true_forces(self, values: Real) -> Real:
        return np.asarray(scipy.spatial.transform.Rotation.from_rotvec(values).as_matrix())


AXIS_MISALIGNMENT = AxisMisalignment()


class ChannelDelay(ChainPhysics):
    """The response channels pass a longer filter, or another converter, than the forces."""

    name = "channel_delay"
    equation = "y_measured(t) = y(t - tau)"
    source = "Bendat & Piersol, Random Data, 4th ed., section 6.1.3"
    parameters = (Parameter("delay_s", "s", 1e-4, -0.1, 0.1),)
    confusable_with = ("ac_coupling", "dynamometer_dynamics")

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        delay = np.exp(-s * values[0])
        return Chain(response=delay[:, None, None] * np.eye(len(model.responses)))


CHANNEL_DELAY = ChannelDelay()


class DynamometerAxes(ChainPhysics):
    """A table with a workpiece rocks and slides at different frequencies: each force axis has its own resonance."""

    name = "dynamometer_axes"
    reported_as = "dynamometer_dynamics"
    equation = "F_measured,q = F_q / (1 + c s + (s / w_q)^2), q = X, Y, Z"
    source = "Korkmaz, Gozen, Bediz & Ozdoganlar 2015, Precision Engineering 39"
    parameters = (
        Parameter("squared_period_x_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("squared_period_y_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("squared_period_z_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("damping_time_s", "s", 2e-5, -1e-2, 1e-2),
    )
    drives = ("force", "moment")
    confusable_with = ("channel_delay", "gain_error")

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place if forces along X, Y and Z are measured."""
        return ("",) if set(axes_of(model.excitations)) == set("XYZ") else ()

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        squared = np.array([values["XYZ".index(axis)] for axis in axes_of(model.excitations)])
        inverse = 1 + values[3] * s[:, None] + squared * s[:, None] ** 2
        return Chain(force=inverse[:, :, None] * np.eye(len(squared)))

    def derived(self, values: Real) -> dict[str, float]:
        """Return the resonance, Hz, and the damping ratio of each axis."""
        resonances = {axis: resonance_of(float(values[k]), float(values[3])) for k, axis in enumerate("xyz")}
        return {f"{axis}_{name}": value for axis, numbers in resonances.items() for name, value in numbers.items()}

    def impossible(self, values: Real, margin: Real) -> str:
        if values[3] >= -margin[3]:
            return ""
        return f"a dynamometer cannot have a negative damping, {values[3]:.3g} s"


DYNAMOMETER_AXES = DynamometerAxes()


class DynamometerDynamics(ChainPhysics):
    """The dynamometer measures the force through its mass and stiffness, and too large a force near its resonance."""

    name = "dynamometer_dynamics"
    equation = "F_measured = F / (1 + 2 zeta s / w_n + (s / w_n)^2)"
    source = "Korkmaz, Gozen, Bediz & Ozdoganlar 2015, Precision Engineering 39"
    parameters = (
        Parameter("squared_period_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("damping_time_s", "s", 2e-5, -1e-2, 1e-2),
    )
    drives = ("force", "moment")
    confusable_with = ("channel_delay",)

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        inverse = 1 + values[1] * s + values[0] * s**2
        return Chain(force=inverse[:, None, None] * np.eye(len(model.excitations)))

    def derived(self, values: Real) -> dict[str, float]:
        """Return the resonance, Hz, and the damping ratio."""
        return resonance_of(float(values[0]), float(values[1]))

    def impossible(self, values: Real, margin: Real) -> str:
        if values[0] <= 0 or values[1] >= -margin[1]:
            return ""
        return f"a dynamometer cannot have a damping ratio of {self.derived(values)['damping_ratio']:.3g}"


DYNAMOMETER_DYNAMICS = DynamometerDynamics()


class DynamometerTableInertia(ChainPhysics):
    """A table, a holder or another tool moves with the structure, and the model lacks its mass."""

    name = "dynamometer_table_inertia"
    equation = "F = F_measured - m X''"
    source = "Ewins, Modal Testing, 2nd ed., section 3.7 (mass cancellation)"
    parameters = (Parameter("mass_kg", "kg", 0.05, -100.0, 100.0),)
    drives, acts_on_motion = ("force", "moment"), True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place if every force has a response along its axis."""
        return ("",) if set(axes_of(model.excitations)) <= set(axes_of(model.responses)) else ()

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        rows = axes_of(model.responses)
        moved = np.zeros((len(model.excitations), len(model.responses)))
        for column, axis in enumerate(axes_of(model.excitations)):
            moved[column, rows.index(axis)] = values[0]
        return Chain(feedback=s[:, None, None] ** 2 * moved)

    def impossible(self, values: Real, margin: Real) -> str:
        if values[0] >= -margin[0]:
            return ""
        return (
            f"a table cannot have a mass of {values[0]:.3g} {self.parameters[0].unit}; a tool lighter than the model's "
            "is other modes"
        )


DYNAMOMETER_TABLE_INERTIA = DynamometerTableInertia()


class GainError(ChainPhysics):
    """A mistyped sensitivity, a changed cable, a switched range: the channel shows a multiple of the truth."""

    name = "gain_error"
    equation = "measured = (1 + e) true, of one channel"
    source = "ISO 16063-21, comparison calibration of vibration transducers"
    parameters = (Parameter("gain_minus_one", "", 0.01, -0.95, 20.0),)
    confusable_with = ("modal_parameters", "axis_misalignment")

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return each channel by its degree of freedom."""
        return (*(f"response {name}" for name in model.responses), *(f"force {name}" for name in model.excitations))

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        kind, label = place.split(" ", 1)
        if kind == "response":
            gains = np.where(np.array(model.responses) == label, 1 + values[0], 1.0)
            return Chain(response=np.tile(np.diag(gains).astype(complex), (len(s), 1, 1)))
        gains = np.where(np.array(model.excitations) == label, 1 / (1 + values[0]), 1.0)
        return Chain(force=np.tile(np.diag(gains).astype(complex), (len(s), 1, 1)))


GAIN_ERROR = GainError()


class CrossTalk(ForceMatrix):
    """Each force channel shows shares of the other two forces: a dynamometer's cross-talk, or a tilted sensor."""

    name = "cross_talk"
    equation = "F_measured = (I + M) F, M with a zero diagonal"
    source = "data sheets of dynamometers, which state the cross-talk of each pair of axes in per cent"
    parameters = tuple(
        Parameter(f"{'xyz'[i]}_of_{'xyz'[j]}", "", 0.01, -0.9, 0.9) for i, j in permutations(range(3), 2)
    )
    confusable_with = ("modal_parameters", "axis_misalignment", "gain_error")

    def true_forces(self, values: Real) -> Real:
        shown = np.eye(3)
        shown[tuple(np.array(list(permutations(range(3), 2))).T)] = values
        return np.asarray(np.linalg.inv(shown))


CROSS_TALK = CrossTalk()


class TransducerResonance(ChainPhysics):
    """A response channel shows the resonance of its transducer's mounting, such as wax, a magnet or a stud."""

    name = "transducer_resonance"
    equation = "y_measured = y / (1 + 2 zeta s / w_n + (s / w_n)^2), of one channel"
    source = "ISO 5348, mechanical mounting of accelerometers"
    parameters: tuple[Parameter, ...] = DynamometerDynamics.parameters
    confusable_with = ("missing_mode", "gain_error", "modal_parameters")
    is_peak = True  # whether the numbers must be those of an underdamped resonance

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return each response channel by its degree of freedom."""
        return tuple(f"response {name}" for name in model.responses)

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        channel = np.array(model.responses) == place.removeprefix("response ")
        shown = np.where(channel, resonant(s, values)[:, None], 1.0 + 0.0j)
        return Chain(response=np.asarray(shown[:, :, None] * np.eye(len(channel))))

    def derived(self, values: Real) -> dict[str, float]:
        """Return the resonance, Hz, and the damping ratio."""
        return resonance_of(float(values[0]), float(values[1]))

    def impossible(self, values: Real, margin: Real) -> str:
        if values[0] > 0 and values[1] < -margin[1]:
            return f"a transducer cannot have a damping ratio of {self.derived(values)['damping_ratio']:.3g}"
        angles = np.linspace(0.0, np.pi / 2, 91)  # of the quarter of the ellipse of errors nearest to a resonance
        squared_periods, lags = values[0] + np.cos(angles) * margin[0], values[1] - np.sin(angles) * margin[1]
        if self.is_peak and (lags > 2 * np.sqrt(np.maximum(squared_periods, 0.0))).all():
            lag = f"{1e3 * values[1]:.3g} ms"
            return f"a transducer damped above critical ({lag}) has no resonance: the channel has another filter"
        return ""


class ChannelCoupling(TransducerResonance):
    """A response channel also shows a share of another one, through a resonance: a cable, a bracket, an amplifier."""

    name = "channel_coupling"
    equation = "y_i,measured = y_i + g y_j / (1 + 2 zeta s / w_n + (s / w_n)^2)"
    source = "Ewins, Modal Testing, 2nd ed., chapter 3"
    parameters = (*DynamometerDynamics.parameters, Parameter("share", "", 0.01, -2.0, 2.0))
    sizes, is_peak = slice(2, 3), False

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return each ordered pair of response channels by their degrees of freedom."""
        return tuple(f"response {i} from {j}" for i, j in permutations(model.responses, 2))

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        shown, through = place.removeprefix("response ").split(" from ")
        response = np.tile(np.eye(len(model.responses), dtype=complex), (len(s), 1, 1))
        response[:, model.responses.index(shown), model.responses.index(through)] += values[2] * resonant(s, values)
        return Chain(response=response)


TRANSDUCER_RESONANCE, CHANNEL_COUPLING = TransducerResonance(), ChannelCoupling()


def resonant(s: Complex, values: Real) -> Complex:
    """Return the response ``1 / (1 + c s + T s^2)`` of a resonance with the numbers T (s^2) and c (s), (n,)."""
    return np.asarray(1 / (1 + values[1] * s + values[0] * s**2))
