"""`ConcealedEffect`: one thing that a real robot or its measuring chain does and its linear model does not."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from modal_fit import ModalModel

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
