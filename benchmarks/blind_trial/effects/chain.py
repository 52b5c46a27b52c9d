"""Faults of the measuring chain that the practice list names."""

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ..excitation import RATE
from .change import Change, Effect, Scene, Signals

FORCES, ACCELERATIONS = ("fx", "fy", "fz"), ("ax", "ay", "az")


def filtered(transfer: NDArray[np.complex128], signals: Signals) -> Signals:
    """Apply a transfer function given on the lines of 65536 samples (per channel or for all), zero-padded."""
    spectrum = np.fft.rfft(signals, 1 << 16, axis=0) * (transfer if transfer.ndim == 2 else transfer[:, None])
    return np.asarray(np.fft.irfft(spectrum, 1 << 16, axis=0)[: len(signals)])


def laplace() -> NDArray[np.complex128]:
    """``s`` on those lines, rad/s."""
    return np.asarray(2j * np.pi * np.fft.rfftfreq(1 << 16, 1 / RATE), dtype=np.complex128)


def dynamometer(scene: Scene, family: str, dial: float) -> Change:
    """``F_measured = F / (1 + 2 zeta s/w + s^2/w^2)``, resonance at ``200/sqrt(dial)`` Hz; one or three axes' own."""
    rng = scene.rng()
    spread = rng.uniform(0.85, 1.2, 3) if family == "each_axis" else np.ones(3)
    zeta = float(rng.uniform(0.01, 0.05))
    resonance = 200 / np.sqrt(dial) * spread
    scaled = laplace()[:, None] / (2 * np.pi * resonance)
    transfer = 1 / (1 + 2 * zeta * scaled + scaled**2)
    parameters: dict[str, Any] = {} if family == "each_axis" else {"fn": float(resonance[0]), "zeta": zeta}
    return Change(force_chain=lambda signals, _: filtered(transfer, signals), parameters=parameters)


def delay(scene: Scene, family: str, dial: float) -> Change:
    """Accelerations late by ``dial`` ms."""
    seconds = 1e-3 * dial
    transfer = np.exp(-laplace() * seconds)
    return Change(acceleration_chain=lambda signals, _: filtered(transfer, signals), parameters={"delay_s": seconds})


def ac_coupling(scene: Scene, family: str, dial: float) -> Change:
    """High-pass ``(s/(s + w))^n`` with its corner at ``dial`` Hz; n = 1, or 2 for two stages."""
    corner = 2 * np.pi * dial
    order = {"one_pole": 1, "two_poles": 2}[family]
    transfer = (laplace() / (laplace() + corner)) ** order
    parameters = {"corner_hz": dial} if order == 1 else {}
    return Change(acceleration_chain=lambda signals, _: filtered(transfer, signals), parameters=parameters)


def misalignment(scene: Scene, family: str, dial: float) -> Change:
    """Force axes turned by ``dial`` degrees (Rodrigues' formula) about a random axis, or about Z."""
    axis = np.array([0.0, 0.0, 1.0]) if family == "about_z" else scene.rng().standard_normal(3)
    axis = axis / np.linalg.norm(axis)
    cross = np.cross(np.eye(3), axis)
    angle = np.radians(dial)
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    parameters = {"rotation_angle_deg": dial, "rotation_axis": axis.tolist()}
    return Change(force_chain=lambda signals, _: signals @ turn.T, parameters=parameters)


def gain(scene: Scene, family: str, dial: float) -> Change:
    """One channel's sensitivity is wrong by ``1 + dial`` or ``1/(1 + dial)``."""
    rng = scene.rng()
    column = int(rng.integers(3))
    factor = 1 + dial if rng.random() < 0.5 else 1 / (1 + dial)
    weights = np.ones(3)
    weights[column] = factor
    if family == "force":
        return Change(force_chain=lambda x, _: x * weights, parameters={"channel": FORCES[column], "gain": factor})
    return Change(
        acceleration_chain=lambda x, _: x * weights, parameters={"channel": ACCELERATIONS[column], "gain": factor}
    )


def clipping(scene: Scene, family: str, dial: float) -> Change:
    """One acceleration channel saturates at ``4/dial`` times its RMS at the middle level: hard (noise before or after
    it), or softly, ``a/(1 + |a/l|^10)^(1/10)``."""
    column = int(scene.rng().integers(3))
    limit = float(4 * scene.accelerations[column] / dial)

    def clip(signals: Signals, _: np.random.Generator) -> Signals:
        clipped = signals.copy()
        if family == "soft":
            clipped[:, column] /= (1 + np.abs(signals[:, column] / limit) ** 10) ** 0.1
        else:
            clipped[:, column] = np.clip(signals[:, column], -limit, limit)
        return clipped

    parameters = {"channel": ACCELERATIONS[column], "limit": limit}
    if family == "hard":
        return Change(after_noise=clip, parameters=parameters)
    return Change(acceleration_chain=clip, parameters=parameters)


EFFECTS = (
    Effect("dynamometer_dynamics", ("one_resonance", "each_axis"), dynamometer, 1.0, 20),
    Effect("channel_delay", ("pure",), delay, 0.2, 60),
    Effect("ac_coupling", ("one_pole", "two_poles"), ac_coupling, 0.3, 15),
    Effect("axis_misalignment", ("any_axis", "about_z"), misalignment, 2.0, 90),
    Effect("gain_error", ("force", "acceleration"), gain, 0.05, 5),
    Effect("clipping", ("hard", "hard_noise_after", "soft"), clipping, 1.5, 20),
)


def quantised(scene: Scene, family: str, dial: float) -> Change:
    """Foreign: converters of few bits, steps of ``dial`` times the RMS."""
    step = dial * scene.accelerations
    return Change(after_noise=lambda x, _: np.round(x / step) * step)


def amplifier(scene: Scene, family: str, dial: float) -> Change:
    """Foreign: the force amplifier compresses, ``F/(1 + dial |F|/F_rms)``."""
    return Change(force_chain=lambda x, _: x / (1 + dial * np.abs(x) / scene.force))


def wandering_delay(scene: Scene, family: str, dial: float) -> Change:
    """Foreign: accelerations late by ``dial (1 + sin(2 pi 0.11 t + phase))`` ms."""

    def late(signals: Signals, rng: np.random.Generator) -> Signals:
        axis = np.arange(len(signals)) / RATE
        shifted = axis - 1e-3 * dial * (1 + np.sin(2 * np.pi * 0.11 * axis + rng.uniform(0, 2 * np.pi)))
        return np.asarray(CubicSpline(axis, signals)(np.clip(shifted, axis[0], axis[-1])))

    return Change(acceleration_chain=late)


def dropouts(scene: Scene, family: str, dial: float) -> Change:
    """Foreign: bursts of 20-100 ms in which one acceleration channel holds its last value, ``dial`` of the time."""
    column = int(scene.rng().integers(3))

    def drop(signals: Signals, rng: np.random.Generator) -> Signals:
        held = signals.copy()
        n_bursts = max(1, round(dial * len(signals) / (0.06 * RATE)))
        for start in rng.integers(RATE, len(signals) - RATE, n_bursts):
            stop = start + int(rng.uniform(0.02, 0.1) * RATE)
            held[start:stop, column] = held[start, column]
        return held

    return Change(acceleration_chain=drop)


def gain_drift(scene: Scene, family: str, dial: float) -> Change:
    """Foreign: all sensitivities sink from 1 to ``1/(1 + dial)`` during each test."""
    return Change(acceleration_chain=partial(_sinking, dial))


def _sinking(dial: float, signals: Signals, _: np.random.Generator) -> Signals:
    return signals / (1 + dial * np.linspace(0, 1, len(signals)))[:, None]


FOREIGN = (
    Effect("quantisation", ("rounding",), quantised, 0.1, 10),
    Effect("force_compression", ("rational",), amplifier, 0.02, 10),
    Effect("wandering_delay", ("slow_sine",), wandering_delay, 0.2, 60),
    Effect("dropouts", ("hold",), dropouts, 0.02, 0.7),
    Effect("gain_drift", ("linear",), gain_drift, 0.05, 20),
)
