"""Milling tests of a simulated robot with one concealed effect, for blind trials of the diagnosis."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import scipy

from acquisition import Block, StreamDescription
from millfrf.core import Real
from modal_fit import ModalModel

from .cells import STREAM, MillingCell
from .joints import LINEAR, JointLaw, tip_motion
from .laboratory import ACETAL_CUTTER, Decimator, Sensor, dynamometer, setup_text, tip_accelerometers
from .robot_structure import real_modes
from .settings import SETTINGS
from .speed_profiles import LinearSweep

Draw = Callable[[np.random.Generator, "JointScale"], dict[str, Any]]

CHANNELS = ("fx", "fy", "fz", "ax", "ay", "az")
FOREIGN = "stiffness_modulation"  # an effect that no library of the diagnosis has: it should name no cause
FINE_RATE = 8192.0  # Hz: sample rate of the simulation
LEVELS = {"low": 0.1e-3, "mid": 0.2e-3, "high": 0.35e-3}  # feed per tooth, m
_RPM = np.pi / 30


@dataclass(frozen=True)
class ConcealedEffect:
    """A concealed effect with its size and place.

    Parameters
    ----------
    name
        One of ``EFFECTS``.
    direction
        Unit vector at the tip along which a joint's effect acts; None for other effects.
    parameters
        Values by name, in SI units or the unit at the end of the name.
    """

    name: str
    direction: tuple[float, float, float] | None
    parameters: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Return plain values that a JSON file can hold."""
        return asdict(self)


@dataclass(frozen=True)
class JointScale:
    """Size of the linear robot's motion along a direction, by which effects get a visible and realistic size."""

    direction: Real  # (3,), unit vector at the tip
    stiffness: float  # N/m: static stiffness along the direction, 1 / (d^T H(0) d)
    deflection: float  # m: root mean square displacement along the direction
    velocity: float  # m/s: root mean square velocity along the direction
    channels: tuple[float, float, float]  # m/s^2: standard deviations of ax ay az
    duration: float  # s: duration of a recording


def joint_scale(structure: ModalModel, motion: tuple[Real, Real, Real], direction: Real, duration: float) -> JointScale:
    """Compute the scale of the tip's motion from displacement, velocity and acceleration, (n, 3) each."""
    displacement, velocity, acceleration = motion
    x, y, z = acceleration.std(axis=0)
    compliance = structure.receptance(np.array([1e-6]))[0].real  # static: 1 uHz
    return JointScale(
        direction,
        float(1 / (direction @ compliance @ direction)),
        float(np.sqrt(np.mean((displacement @ direction) ** 2))),
        float(np.sqrt(np.mean((velocity @ direction) ** 2))),
        (float(x), float(y), float(z)),
        duration,
    )


def draw_effect(name: str, generator: np.random.Generator, scale: JointScale) -> ConcealedEffect:
    """Draw the parameters of an effect."""
    x, y, z = (float(component) for component in scale.direction)
    return ConcealedEffect(name, (x, y, z) if name in JOINT_EFFECTS else None, EFFECTS[name](generator, scale))


def draw_name(generator: np.random.Generator) -> str:
    """Draw the name of an effect; all of ``EFFECTS`` are equally likely."""
    return str(generator.choice(list(EFFECTS)))


def _sign(generator: np.random.Generator) -> float:
    return float(generator.choice((-1.0, 1.0)))


def _vector(generator: np.random.Generator, length: float) -> list[float]:
    """Draw a vector of this length in a random direction."""
    raw = generator.standard_normal(3)
    return [float(value) for value in length * raw / np.linalg.norm(raw)]


def _changed_modes(g: np.random.Generator, s: JointScale) -> dict[str, Any]:
    frequency = [float(1 + _sign(g) * g.uniform(0.03, 0.06)) for _ in range(3)]
    return {"frequency_factors": frequency, "damping_factors": [float(g.choice((0.6, 1.6))) for _ in range(3)]}


def _hysteresis(g: np.random.Generator, s: JointScale) -> dict[str, Any]:
    yield_deflection = g.uniform(0.2, 0.6) * s.deflection
    return {
        "stiffness_n_per_m": g.uniform(0.2, 0.5) * s.stiffness,
        "beta_per_m": 0.6 / yield_deflection,
        "gamma_per_m": 0.4 / yield_deflection,
    }


def _clipping(g: np.random.Generator, s: JointScale) -> dict[str, Any]:
    axis = int(g.integers(3))
    return {"channel": CHANNELS[3 + axis], "limit_m_per_s2": g.uniform(1.8, 2.6) * s.channels[axis]}


# effects of one joint, each with the draw of its parameters in the order of joint_force
JOINT_EFFECTS: dict[str, Draw] = {
    "stiffness_hardening": lambda g, s: {"k3_n_per_m3": g.uniform(0.1, 0.3) * s.stiffness / (3 * s.deflection) ** 2},
    "stiffness_softening": lambda g, s: {
        "stiffness_loss_n_per_m": g.uniform(0.3, 0.6) * s.stiffness,
        "knee_m": g.uniform(0.6, 1.5) * s.deflection,
    },
    "backlash": lambda g, s: {
        "stiffness_loss_n_per_m": g.uniform(0.25, 0.5) * s.stiffness,
        "half_gap_m": g.uniform(0.4, 1.0) * s.deflection,
    },
    "coulomb_friction": lambda g, s: {
        "friction_n": g.uniform(0.08, 0.2) * s.stiffness * s.deflection,
        "creep_speed_m_per_s": g.uniform(0.03, 0.08) * s.velocity,
    },
    "hysteresis": _hysteresis,
    "pose_drift": lambda g, s: {
        "stiffness_change_n_per_m": _sign(g) * g.uniform(0.15, 0.4) * s.stiffness,
        "duration_s": s.duration,
    },
    FOREIGN: lambda g, s: {
        "stiffness_n_per_m": g.uniform(0.15, 0.35) * s.stiffness,
        "rad_per_s": 2 * np.pi * g.uniform(3.0, 6.0),
    },
}
# all effects that may be concealed
EFFECTS: dict[str, Draw] = {
    "none": lambda g, s: {},
    "modal_parameters": _changed_modes,
    **JOINT_EFFECTS,
    "missing_mode": lambda g, s: {
        "frequency_hz": g.uniform(32.0, 42.0),
        "damping_ratio": g.uniform(0.02, 0.05),
        "shape": _vector(g, g.uniform(0.03, 0.05)),
    },
    "gyroscopic_coupling": lambda g, s: {"coupling_ns_per_m": _vector(g, g.uniform(0.3, 0.6) * s.stiffness / 100.0)},
    "dynamometer_dynamics": lambda g, s: {
        "frequency_hz": g.uniform(60.0, 110.0),
        "damping_ratio": g.uniform(0.02, 0.05),
    },
    "channel_delay": lambda g, s: {"delay_s": g.uniform(2e-3, 6e-3)},
    "ac_coupling": lambda g, s: {"corner_hz": g.uniform(1.0, 3.0)},
    "axis_misalignment": lambda g, s: {"rotation_deg": _vector(g, g.uniform(8.0, 15.0))},
    "gain_error": lambda g, s: {"channel": CHANNELS[int(g.integers(6))], "gain": float(g.choice((0.7, 1.35)))},
    "clipping": _clipping,
    "unmeasured_excitation": lambda g, s: {
        "frequency_hz": g.uniform(8.0, 35.0),
        "force_n": _vector(g, g.uniform(0.05, 0.15) * s.stiffness * s.deflection),
    },
}


def through_chain(effect: ConcealedEffect, signals: Real, rate: float) -> Real:
    """Apply faults of the analogue measuring chain to ``fx fy fz ax ay az``, (n, 6), sampled at ``rate`` (Hz)."""
    values, measured = effect.parameters, signals.copy()
    if effect.name == "channel_delay":
        delayed = np.arange(len(signals)) - values["delay_s"] * rate
        for column in (3, 4, 5):
            measured[:, column] = np.interp(delayed, np.arange(len(signals)), signals[:, column], left=0.0)
    elif effect.name == "ac_coupling":
        corner = 2 * np.pi * values["corner_hz"]
        high_pass = scipy.signal.bilinear([1.0, 0.0], [1.0, corner], rate)
        measured[:, 3:] = scipy.signal.lfilter(*high_pass, signals[:, 3:], axis=0)
    elif effect.name == "dynamometer_dynamics":
        natural, zeta = 2 * np.pi * values["frequency_hz"], values["damping_ratio"]
        resonance = scipy.signal.bilinear([natural**2], [1.0, 2 * zeta * natural, natural**2], rate)
        measured[:, :3] = scipy.signal.lfilter(*resonance, signals[:, :3], axis=0)
    elif effect.name == "axis_misalignment":
        rotation = scipy.spatial.transform.Rotation.from_rotvec(values["rotation_deg"], degrees=True)
        measured[:, :3] = rotation.apply(signals[:, :3])
    elif effect.name == "gain_error":
        measured[:, CHANNELS.index(values["channel"])] *= values["gain"]
    return measured


def in_converter(effect: ConcealedEffect, samples: Real) -> Real:
    """Clip the samples of a channel, noise included, where the effect is clipping."""
    measured = samples.copy()
    if effect.name == "clipping":
        column, limit = CHANNELS.index(effect.parameters["channel"]), effect.parameters["limit_m_per_s2"]
        measured[:, column] = np.clip(measured[:, column], -limit, limit)
    return measured


def concealed_structure(structure: ModalModel, effect: ConcealedEffect) -> ModalModel:
    """Return the structure during milling; ``structure`` (real modes) is the structure at rest."""
    natural, zeta, shapes = 2 * np.pi * structure.natural_frequencies, structure.damping_ratios, structure.left.real
    values = effect.parameters
    if effect.name == "modal_parameters":
        return real_modes(natural * values["frequency_factors"], zeta * values["damping_factors"], shapes)
    if effect.name == "missing_mode":
        natural = np.append(natural, 2 * np.pi * values["frequency_hz"])
        return real_modes(natural, np.append(zeta, values["damping_ratio"]), np.vstack([shapes, values["shape"]]))
    return structure


def concealed_law(effect: ConcealedEffect) -> JointLaw:
    """Return the joint law during milling; it is linear for effects that are not in a joint."""
    if effect.name == "gyroscopic_coupling":
        x, y, z = effect.parameters["coupling_ns_per_m"]
        return LINEAR._replace(coupling=np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
    if effect.name not in JOINT_EFFECTS or effect.direction is None:
        return LINEAR
    values = np.zeros(3)
    values[: len(effect.parameters)] = list(effect.parameters.values())
    return LINEAR._replace(name=effect.name, direction=np.array(effect.direction), parameters=values)


def unmeasured_force(effect: ConcealedEffect, times: Real) -> Real:
    """Return the force (n, 3), N, at ``times`` (s) that acts on the tip and that the dynamometer does not measure."""
    if effect.name != "unmeasured_excitation":
        return np.zeros((len(times), 3))
    values: dict[str, Any] = effect.parameters
    return np.asarray(np.sin(2 * np.pi * values["frequency_hz"] * times)[:, None] * np.array(values["force_n"]))


def milling_force(structure: ModalModel, level: str, seconds: float, seed: int) -> Real:
    """Simulate the force on the tip of the linear robot in porous material, (n, 3), N, at ``FINE_RATE``."""
    # the middle level is swept downwards
    first, last = SETTINGS.sweep_rpm if level != "mid" else SETTINGS.sweep_rpm[::-1]
    start, leave = SETTINGS.immersion_over_pi
    cutter = replace(ACETAL_CUTTER, start_angle=start * np.pi, exit_angle=leave * np.pi, feed_per_tooth=LEVELS[level])
    cell = MillingCell(
        structure,
        cutter,
        SETTINGS.axial_depth,
        LinearSweep(first * _RPM, last * _RPM, seconds),
        seconds,
        sample_rate=FINE_RATE,
        material="porous",
        sensors=dynamometer(0.0, 1e5),
        seed=seed,
    )
    return cell.samples()


class ConcealedCell:
    """A milled robot under given forces, with one concealed effect, measured by six channels.

    The forces come from a cut of the linear robot: the change of the motion by the effect does not change them.
    Implements :class:`acquisition.Source`.

    Parameters
    ----------
    structure
        The structure at rest, as hammer tests identify it: real modes at the tip.
    force : (n, 3), N
        Force on the tip, at 8192 Hz, from :func:`milling_force`.
    effect
        The concealed effect.
    noise
        White noise of the accelerations, as a share of each channel's standard deviation; the forces get half this
        share.
    seed
        Seed of the noise.
    """

    def __init__(self, structure: ModalModel, force: Real, effect: ConcealedEffect, noise: float, seed: int) -> None:
        self._structure, self._force, self._effect = structure, force, effect
        self._noise, self._seed = noise, seed
        self.n_samples = round(len(force) * SETTINGS.recording_rate / FINE_RATE)
        channels = tuple(sensor.channel() for sensor in self._sensors())
        self.streams = (StreamDescription(STREAM, SETTINGS.recording_rate, 0.0, channels),)
        self.title = "simulated milling of a robot, porous material, speed sweep"
        self.setup = setup_text({"test": {"kind": "simulated milling", "duration_s": len(force) / FINE_RATE}})
        self._samples: Real | None = None

    def open(self) -> None:
        """Simulate the complete recording."""
        self._samples = self.samples()

    def read(self) -> Block | None:
        """Return all samples in one block, then None."""
        samples, self._samples = self._samples, None
        return None if samples is None else Block(STREAM, 0, samples, len(samples) / SETTINGS.recording_rate)

    def close(self) -> None:
        """Discard the samples."""
        self._samples = None

    def samples(self) -> Real:
        """Return the recording (n_samples, 6): forces in N, then accelerations in m/s^2."""
        clean = self.clean()
        sizes = clean.std(axis=0) * self._noise * np.array([0.5, 0.5, 0.5, 1.0, 1.0, 1.0])
        noisy = clean + sizes * np.random.default_rng(self._seed).standard_normal(clean.shape)
        return in_converter(self._effect, noisy)

    def clean(self) -> Real:
        """Return the recording without noise and clipping."""
        structure = concealed_structure(self._structure, self._effect)
        times = np.arange(len(self._force)) / FINE_RATE
        force = self._force + unmeasured_force(self._effect, times)
        acceleration = tip_motion(structure, force, 1 / FINE_RATE, concealed_law(self._effect))[2]
        measured = through_chain(self._effect, np.hstack([self._force, acceleration]), FINE_RATE)
        decimator = Decimator(round(FINE_RATE / SETTINGS.recording_rate), measured.shape[1])
        # the last value is repeated until the filter has given all samples
        padded = np.vstack([measured, np.tile(measured[-1:], (decimator.lookahead + 1, 1))])
        return np.asarray(decimator(padded)[: self.n_samples])

    def _sensors(self) -> tuple[Sensor, ...]:
        accelerometers = tip_accelerometers(high_pass_hz=None)
        return dynamometer() + tuple(
            replace(sensor, name=name) for sensor, name in zip(accelerometers, CHANNELS[3:], strict=True)
        )
