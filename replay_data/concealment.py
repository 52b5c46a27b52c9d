"""Milling tests of a simulated robot that hides one effect, for blind trials of the diagnosis."""

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from acquisition import Block, StreamDescription
from millfrf.core import Real
from modal_fit import ModalModel

from .cells import STREAM, MillingCell
from .joints import LINEAR, JointLaw, tip_motion
from .laboratory import ACETAL_CUTTER, Decimator, Sensor, dynamometer, setup_text, tip_accelerometers
from .robot_structure import real_modes
from .speed_profiles import LinearSweep

Draw = Callable[[np.random.Generator, "JointScale"], dict[str, Any]]

CHANNELS = ("fx", "fy", "fz", "ax", "ay", "az")
FOREIGN = "stiffness_modulation"
"""An effect for which no library has a name: the right answer is to abstain."""


@dataclass(frozen=True)
class ConcealedEffect:
    """A hidden effect with its size and place.

    Parameters
    ----------
    name
        One of ``EFFECTS``.
    direction
        Unit vector at the tip along which a joint's effect acts; None for other effects.
    parameters
        SI units, or as named.
    """

    name: str
    direction: tuple[float, float, float] | None
    parameters: dict[str, Any]

    def to_json(self) -> dict[str, Any]:
        """Give plain values that a JSON file can hold."""
        return asdict(self)


@dataclass(frozen=True)
class JointScale:
    """How far and how fast the linear robot moves along a direction, so that an effect is neither nothing nor absurd.

    Parameters
    ----------
    direction : (3,)
        Unit vector of the direction at the tip.
    stiffness : N/m
        Static stiffness along the direction, ``1 / (d^T H(0) d)``.
    deflection, velocity
        Root mean square of displacement (m) and velocity (m/s) along the direction.
    channels : m/s^2
        Root mean square of ``ax ay az`` without their mean.
    duration : s
        Duration of a recording.
    """

    direction: NDArray[np.float64]
    stiffness: float
    deflection: float
    velocity: float
    channels: tuple[float, float, float]
    duration: float


def joint_scale(
    structure: ModalModel,
    motion: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    direction: NDArray[np.float64],
    duration: float,
) -> JointScale:
    """Scale of a motion of the tip: displacement, velocity and acceleration, (n, 3) each."""
    displacement, velocity, acceleration = motion
    x, y, z = acceleration.std(axis=0)
    static = structure.receptance(np.array([1e-6]))[0].real
    return JointScale(
        direction,
        float(1 / (direction @ static @ direction)),
        _size(displacement @ direction),
        _size(velocity @ direction),
        (float(x), float(y), float(z)),
        duration,
    )


def _size(signal: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(signal**2)))


def draw_effect(name: str, generator: np.random.Generator, scale: JointScale) -> ConcealedEffect:
    """Draw the parameters of an effect."""
    x, y, z = (float(part) for part in scale.direction)
    return ConcealedEffect(name, (x, y, z) if name in JOINT_EFFECTS else None, EFFECTS[name](generator, scale))


def draw_name(generator: np.random.Generator) -> str:
    """Draw the effect itself: all of ``EFFECTS`` are equally likely."""
    return str(generator.choice(list(EFFECTS)))


def _sign(generator: np.random.Generator) -> float:
    return float(generator.choice((-1.0, 1.0)))


def _vector(generator: np.random.Generator, length: float) -> list[float]:
    raw = generator.standard_normal(3)
    return [float(value) for value in length * raw / np.linalg.norm(raw)]


def _changed_modes(g: np.random.Generator, s: JointScale) -> dict[str, Any]:
    frequency = [float(1 + _sign(g) * g.uniform(0.03, 0.06)) for _ in range(3)]
    return {"frequency_factors": frequency, "damping_factors": [float(g.choice((0.6, 1.6))) for _ in range(3)]}


def _hysteresis(g: np.random.Generator, s: JointScale) -> dict[str, Any]:
    yields = g.uniform(0.2, 0.6) * s.deflection
    return {
        "stiffness_n_per_m": g.uniform(0.2, 0.5) * s.stiffness,
        "beta_per_m": 0.6 / yields,
        "gamma_per_m": 0.4 / yields,
    }


def _clipping(g: np.random.Generator, s: JointScale) -> dict[str, Any]:
    place = int(g.integers(3))
    return {"channel": CHANNELS[3 + place], "limit_m_per_s2": g.uniform(1.8, 2.6) * s.channels[place]}


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
"""Effects of one joint, with how their parameters are drawn."""

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
"""All that may be hidden, with how their parameters are drawn."""


def through_chain(effect: ConcealedEffect, signals: Real, rate: float) -> Real:
    """Analogue faults on ``fx fy fz ax ay az``, (n, 6), sampled finely at ``rate`` (Hz)."""
    values, shown = effect.parameters, signals.copy()
    if effect.name == "channel_delay":
        late = np.arange(len(signals)) - values["delay_s"] * rate
        for column in (3, 4, 5):
            shown[:, column] = np.interp(late, np.arange(len(signals)), signals[:, column], left=0.0)
    elif effect.name == "ac_coupling":
        corner = 2 * np.pi * values["corner_hz"]
        shown[:, 3:] = scipy.signal.lfilter(
            *scipy.signal.bilinear([1.0, 0.0], [1.0, corner], rate), signals[:, 3:], axis=0
        )
    elif effect.name == "dynamometer_dynamics":
        natural, zeta = 2 * np.pi * values["frequency_hz"], values["damping_ratio"]
        resonance = scipy.signal.bilinear([natural**2], [1.0, 2 * zeta * natural, natural**2], rate)
        shown[:, :3] = scipy.signal.lfilter(*resonance, signals[:, :3], axis=0)
    elif effect.name == "axis_misalignment":
        shown[:, :3] = scipy.spatial.transform.Rotation.from_rotvec(values["rotation_deg"], degrees=True).apply(
            signals[:, :3]
        )
    elif effect.name == "gain_error":
        shown[:, CHANNELS.index(values["channel"])] *= values["gain"]
    return shown


def in_converter(effect: ConcealedEffect, samples: Real) -> Real:
    """Saturation of a channel, noise included."""
    shown = samples.copy()
    if effect.name == "clipping":
        column, limit = CHANNELS.index(effect.parameters["channel"]), effect.parameters["limit_m_per_s2"]
        shown[:, column] = np.clip(shown[:, column], -limit, limit)
    return shown


def concealed_structure(structure: ModalModel, effect: ConcealedEffect) -> ModalModel:
    """The structure that is milled, of which the taps knew only ``structure`` (real modes)."""
    natural, zeta, shapes = 2 * np.pi * structure.natural_frequencies, structure.damping_ratios, structure.left.real
    values = effect.parameters
    if effect.name == "modal_parameters":
        factors = (np.array(values[name]) for name in ("frequency_factors", "damping_factors"))
        return real_modes(natural * next(factors), zeta * next(factors), shapes)
    if effect.name == "missing_mode":
        more = (2 * np.pi * values["frequency_hz"], values["damping_ratio"], values["shape"])
        return real_modes(np.append(natural, more[0]), np.append(zeta, more[1]), np.vstack([shapes, more[2]]))
    return structure


def concealed_law(effect: ConcealedEffect) -> JointLaw:
    """The law that acts on the tip while milling; that of nothing for effects elsewhere."""
    if effect.name == "gyroscopic_coupling":
        x, y, z = effect.parameters["coupling_ns_per_m"]
        return LINEAR._replace(coupling=np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))
    if effect.name not in JOINT_EFFECTS or effect.direction is None:
        return LINEAR
    values = np.zeros(3)
    values[: len(effect.parameters)] = list(effect.parameters.values())
    return LINEAR._replace(name=effect.name, direction=np.array(effect.direction), parameters=values)


def unmeasured_force(effect: ConcealedEffect, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force (n, 3) that shakes the tip and passes no dynamometer, N, at ``times`` (s)."""
    if effect.name != "unmeasured_excitation":
        return np.zeros((len(times), 3))
    values: dict[str, Any] = effect.parameters
    return np.asarray(np.sin(2 * np.pi * values["frequency_hz"] * times)[:, None] * np.array(values["force_n"]))


FINE_RATE, RATE = 8192.0, 512.0
"""Sample rates of the simulation and of the recordings, Hz."""

RPM = math.pi / 30
SWEEP_RPM = (240.0, 1080.0)
"""8 to 36 tooth passes a second."""

DEPTH = 1e-3
IMMERSION = (0.38 * math.pi, math.pi)
LEVELS = {"low": 0.1e-3, "mid": 0.2e-3, "high": 0.35e-3}
"""Feed per tooth, m."""

CUTTER = replace(ACETAL_CUTTER, start_angle=IMMERSION[0], exit_angle=IMMERSION[1], feed_per_tooth=LEVELS["mid"])


def milling_force(structure: ModalModel, level: str, seconds: float, seed: int) -> Real:
    """Force on the tip of the linear robot while it mills porous material, (n, 3), N, at :data:`FINE_RATE`."""
    first, last = SWEEP_RPM if level != "mid" else SWEEP_RPM[::-1]
    cell = MillingCell(
        structure,
        replace(CUTTER, feed_per_tooth=LEVELS[level]),
        DEPTH,
        LinearSweep(first * RPM, last * RPM, seconds),
        seconds,
        sample_rate=FINE_RATE,
        material="porous",
        sensors=dynamometer(0.0, 1e5),
        seed=seed,
    )
    return cell.samples()


class ConcealedCell:
    """A milled robot under given forces, with one effect in it, measured by six channels.

    The forces are those of a cut of the linear robot: what the effect changes in the motion does not act back on them.
    Implements :class:`acquisition.Source`.

    Parameters
    ----------
    structure
        What taps at rest would find: real modes at the tip.
    force : (n, 3), N
        Force on the tip, at :data:`FINE_RATE`.
    effect
        The effect that is hidden.
    noise
        White noise of the accelerations, as a share of each channel's standard deviation; half of it on the forces.
    seed
        Seed of the noise.
    """

    def __init__(self, structure: ModalModel, force: Real, effect: ConcealedEffect, noise: float, seed: int) -> None:
        self._structure, self._force, self._effect = structure, force, effect
        self._noise, self._seed = noise, seed
        self.n_samples = round(len(force) * RATE / FINE_RATE)
        channels = tuple(sensor.channel() for sensor in self._sensors())
        self.streams = (StreamDescription(STREAM, RATE, 0.0, channels),)
        self.title = "simulated milling of a robot, porous material, speed sweep"
        self.setup = setup_text({"test": {"kind": "simulated milling", "duration_s": len(force) / FINE_RATE}})
        self._samples: Real | None = None

    def open(self) -> None:
        """Simulate the whole recording."""
        self._samples = self.samples()

    def read(self) -> Block | None:
        """All samples in one block, then None."""
        samples, self._samples = self._samples, None
        return None if samples is None else Block(STREAM, 0, samples, len(samples) / RATE)

    def close(self) -> None:
        """Let go of the samples."""
        self._samples = None

    def samples(self) -> Real:
        """The recording (n_samples, 6): N and m/s^2."""
        clean = self.clean()
        sizes = clean.std(axis=0) * self._noise * np.array([0.5, 0.5, 0.5, 1.0, 1.0, 1.0])
        noisy = clean + sizes * np.random.default_rng(self._seed).standard_normal(clean.shape)
        return in_converter(self._effect, noisy)

    def clean(self) -> Real:
        """The recording without noise and saturation."""
        structure = concealed_structure(self._structure, self._effect)
        times = np.arange(len(self._force)) / FINE_RATE
        shaken = self._force + unmeasured_force(self._effect, times)
        acceleration = tip_motion(structure, shaken, 1 / FINE_RATE, concealed_law(self._effect))[2]
        shown = through_chain(self._effect, np.hstack([self._force, acceleration]), FINE_RATE)
        decimator = Decimator(round(FINE_RATE / RATE), shown.shape[1])
        padded = np.vstack([shown, np.tile(shown[-1:], (decimator.lookahead + 1, 1))])
        return np.asarray(decimator(padded)[: self.n_samples])

    def _sensors(self) -> tuple[Sensor, ...]:
        places = tip_accelerometers(high_pass_hz=None)
        return dynamometer() + tuple(
            replace(sensor, name=name) for sensor, name in zip(places, ("ax", "ay", "az"), strict=True)
        )
