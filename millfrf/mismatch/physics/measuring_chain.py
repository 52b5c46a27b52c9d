"""Causes in the measuring chain: gain, delay, coupling, axes, dynamometer, clipping, foreign tones."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import scipy

from estimation import BandRecording
from millfrf.core import Complex, DegreeOfFreedom, Real
from modal_fit import ModalModel

from ..joints.joint_law import saturated
from .protocol import Chain, Parameter, axes_of, resonance_of

TWO_STAGES = "two stages"


class AcCoupling:
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
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        passed = (s / (s + 2 * np.pi * values[0])) ** (2 if place == TWO_STAGES else 1)
        return Chain(response=passed[:, None, None] * np.eye(len(model.responses)))

    def other_forms(self, values: Real, place: str) -> tuple[tuple[str, Real], ...]:
        """Return the other number of stages, with the corner that gives the same phase ``n f_c / f`` well above it."""
        return (("", 2 * values),) if place == TWO_STAGES else ((TWO_STAGES, values / 2),)


AC_COUPLING = AcCoupling()


class AxisMisalignment:
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
    confusable_with = (
        "modal_parameters",
        "gain_error",
    )

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return the three columns that are X, Y, Z of one node; none without such a triad."""
        return _triad(model)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0, 0.0, 0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        columns = [int(place) for place in place.split()]
        rotation = np.eye(len(model.excitations))
        rotation[np.ix_(columns, columns)] = scipy.spatial.transform.Rotation.from_rotvec(values).as_matrix()
        return Chain(force=np.tile(rotation.astype(complex), (len(s), 1, 1)))


def _triad(model: ModalModel) -> tuple[str, ...]:
    axes = [DegreeOfFreedom.parse(label).axis for label in model.excitations]
    if any(axes.count(axis) != 1 for axis in "XYZ"):
        return ()
    return (" ".join(str(axes.index(axis)) for axis in "XYZ"),)


AXIS_MISALIGNMENT = AxisMisalignment()


class ChannelDelay:
    """The response channels pass a longer filter, or another converter, than the forces."""

    name = "channel_delay"
    equation = "y_measured(t) = y(t - tau)"
    source = "Bendat & Piersol, Random Data, 4th ed., section 6.1.3"
    parameters = (Parameter("delay_s", "s", 1e-4, -0.1, 0.1),)
    confusable_with = (
        "ac_coupling",
        "dynamometer_dynamics",
    )

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place: the whole measuring chain."""
        return ("",)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        late = np.exp(-s * values[0])
        return Chain(response=late[:, None, None] * np.eye(len(model.responses)))


CHANNEL_DELAY = ChannelDelay()


class Clipping:
    """An amplifier or a converter that is driven beyond its range, sharply or rounding off before its limit."""

    order = 1
    name = "clipping"
    equation = "y_shown = y / (1 + |y / l|^n)^(1/n), sharp for n = infinity"
    source = "Godsill & Rayner, Digital Audio Restoration, 1998, section 4.1"
    parameters: tuple[Parameter, ...] = (Parameter("limit", "unit of the channel", 0.01, 0.0),)
    confusable_with = ("stiffness_hardening",)

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) whose clipped channel is held below the limit."""
        response = response.copy()
        column = recording.channels.index(term["location"]["channel"]) - recording.force.shape[1]
        limit, sharpness = (float(term["parameters"].get(name, np.inf)) for name in ("limit", "sharpness"))
        response[:, column] = saturated(response[:, column], limit, sharpness)
        return response


CLIPPING = Clipping()


class DynamometerAxes:
    """A table with a workpiece rocks at other frequencies than it slides: each force axis has its own resonance."""

    name = "dynamometer_axes"
    answers_as = "dynamometer_dynamics"
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

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.zeros(4)

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        squared = np.array([values["XYZ".index(axis)] for axis in axes_of(model.excitations)])
        own = 1 + values[3] * s[:, None] + squared * s[:, None] ** 2
        return Chain(force=own[:, :, None] * np.eye(len(squared)))

    def derived(self, values: Real) -> dict[str, float]:
        """Return the resonance, Hz, and the damping ratio of each axis."""
        found = {axis: resonance_of(float(values[k]), float(values[3])) for k, axis in enumerate("xyz")}
        return {f"{axis}_{name}": value for axis, one in found.items() for name, value in one.items()}

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why these numbers are impossible by more than their margins of error; empty where they are possible."""
        if values[3] >= -margin[3]:
            return ""
        return f"a dynamometer cannot have a negative damping, {values[3]:.3g} s"


DYNAMOMETER_AXES = DynamometerAxes()


class DynamometerDynamics:
    """The dynamometer shows the force through its own mass and spring; near its resonance it shows too much."""

    name = "dynamometer_dynamics"
    equation = "F_measured = F / (1 + 2 zeta s / w_n + (s / w_n)^2)"
    source = "Korkmaz, Gozen, Bediz & Ozdoganlar 2015, Precision Engineering 39"
    parameters = (
        Parameter("squared_period_s2", "s^2", 2e-7, 0.0, 1e-3),
        Parameter("damping_time_s", "s", 2e-5, -1e-2, 1e-2),
    )
    drives = ("force", "moment")
    confusable_with = ("channel_delay",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place: the whole measuring chain."""
        return ("",)

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0, 0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        whole = 1 + values[1] * s + values[0] * s**2
        return Chain(force=whole[:, None, None] * np.eye(len(model.excitations)))

    def derived(self, values: Real) -> dict[str, float]:
        """Return the resonance, Hz, and the damping ratio."""
        return resonance_of(float(values[0]), float(values[1]))

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why these numbers are impossible by more than their margins of error; empty where they are possible."""
        if values[0] <= 0 or values[1] >= -margin[1]:
            return ""
        return f"a dynamometer cannot have a damping ratio of {self.derived(values)['damping_ratio']:.3g}"


DYNAMOMETER_DYNAMICS = DynamometerDynamics()


class DynamometerTableInertia:
    """A table, a holder or another tool moves with the structure, and the model does not have its mass."""

    name = "dynamometer_table_inertia"
    equation = "F = F_measured - m X''"
    source = "Ewins, Modal Testing, 2nd ed., section 3.7 (mass cancellation)"
    parameters = (Parameter("mass_kg", "kg", 0.05, -100.0, 100.0),)
    drives, acts_on_motion = ("force", "moment"), True
    confusable_with = ("modal_parameters",)

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return one place if every force has a response along its axis."""
        return ("",) if set(axes_of(model.excitations)) <= set(axes_of(model.responses)) else ()

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        rows = axes_of(model.responses)
        moved = np.zeros((len(model.excitations), len(model.responses)))
        for column, axis in enumerate(axes_of(model.excitations)):
            moved[column, rows.index(axis)] = values[0]
        return Chain(feedback=s[:, None, None] ** 2 * moved)

    def impossible(self, values: Real, margin: Real) -> str:
        """Say why these numbers are impossible by more than their margins of error; empty where they are possible."""
        if values[0] >= -margin[0]:
            return ""
        return (
            f"a table cannot have a mass of {values[0]:.3g} {self.parameters[0].unit}; a tool lighter than the model's "
            "is other modes"
        )


DYNAMOMETER_TABLE_INERTIA = DynamometerTableInertia()


class GainError:
    """A sensitivity mistyped, a cable changed, a range switched: the channel shows a multiple of the truth."""

    name = "gain_error"
    equation = "measured = (1 + e) true, of one channel"
    source = "ISO 16063-21, comparison calibration of vibration transducers"
    parameters = (Parameter("gain_minus_one", "", 0.01, -0.95, 20.0),)
    confusable_with = (
        "modal_parameters",
        "axis_misalignment",
    )

    def places(self, model: ModalModel) -> tuple[str, ...]:
        """Return each channel by its degree of freedom."""
        return (*(f"response {name}" for name in model.responses), *(f"force {name}" for name in model.excitations))

    def start(self, model: ModalModel) -> Real:
        """Return the numbers at which the cause is absent."""
        return np.array([0.0])

    def chain(self, s: Complex, values: Real, place: str, model: ModalModel) -> Chain:
        """Return the matrices of the cause at ``s`` (n,), rad/s."""
        kind, label = place.split(" ", 1)
        if kind == "response":
            gains = np.where(np.array(model.responses) == label, 1 + values[0], 1.0)
            return Chain(response=np.tile(np.diag(gains).astype(complex), (len(s), 1, 1)))
        gains = np.where(np.array(model.excitations) == label, 1 / (1 + values[0]), 1.0)
        return Chain(force=np.tile(np.diag(gains).astype(complex), (len(s), 1, 1)))


GAIN_ERROR = GainError()


class UnmeasuredExcitation:
    """The responses hold a sinusoid that no measured force explains."""

    order = 0
    name = "unmeasured_excitation"
    equation = "y_shown = y + A cos(2 pi f t + phi)"
    source = "Bendat & Piersol, Random Data, 4th ed., section 6.1.4 (extraneous noise)"
    parameters: tuple[Parameter, ...] = (Parameter("frequency_hz", "Hz", 0.01, 0.0),)
    confusable_with = ("missing_mode",)

    def shown(self, response: Real, recording: BandRecording, start: int, term: Mapping[str, Any]) -> Real:
        """Return a predicted response (n_samples, n_responses) with the tone.

        A steady tone has no known phase in another recording: amplitude and phase are read from the recording at that
        one frequency.
        """
        time = np.arange(len(response)) / recording.rate
        rest = recording.response[: len(response)] - response
        return response + tone_of(rest, time, float(term["parameters"]["frequency_hz"]), start)


def tone_of(rest: Real, time: Real, frequency: float, start: int) -> Real:
    """Return the sinusoid in a residual whose frequency is near a given one, (n_samples, n_responses).

    Parameters
    ----------
    rest : (n_samples, n_responses)
        Residual that holds the tone.
    time : (n_samples,), s
        Times of the samples.
    frequency
        Frequency near which the strongest line is taken, Hz.
    start
        First sample after the run-in.
    """
    kept, late = rest[start:], time[start:]
    fine = 8 * len(kept)
    spectrum = np.abs(scipy.fft.rfft(kept * np.hanning(len(kept))[:, None], n=fine, axis=0)) ** 2
    axis = np.arange(fine // 2 + 1) / fine / (late[1] - late[0])
    near = np.abs(axis - frequency) < 2.0 / (late[-1] - late[0])
    exact = float(axis[near][np.argmax(spectrum[near].sum(axis=1))]) if near.any() else frequency
    waves = np.column_stack([np.cos(2 * np.pi * exact * time), np.sin(2 * np.pi * exact * time)])
    return np.asarray(waves @ np.linalg.lstsq(waves[start:], kept, rcond=None)[0])


UNMEASURED_EXCITATION = UnmeasuredExcitation()
