"""A rig of one mode with a cubic spring, simulated on its own: forces, recordings and what a lab believes of it."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acquisition import RecordingWriter, StreamDescription
from estimation import BandRecording, channels_of
from modal_fit import ModalModel

Real = NDArray[np.float64]
PLACE = ("TCP:+X",)
NOISE, PERIOD, PERIODS = 0.01, 1024, 8


@dataclass(frozen=True)
class Rig:
    """``m x'' + c x' + k x + k3 x^3 = f``, whatever m, f and x stand for.

    Parameters
    ----------
    frequency, damping
        Natural frequency (Hz) and damping ratio of the linear part.
    mass
        kg; kg m^2 where the force is a moment and the deflection an angle.
    cubic
        k3, N/m^3.
    excitation, response
        Quantities of the channels; acceleration is the second derivative of the deflection, velocity the first.
    rate
        Samples a second.
    """

    frequency: float = 10.0
    damping: float = 0.03
    mass: float = 20.0
    cubic: float = 0.0
    excitation: str = "force"
    response: str = "acceleration"
    rate: float = 128.0

    @property
    def stiffness(self) -> float:
        return self.mass * (2 * np.pi * self.frequency) ** 2

    @property
    def driven(self) -> tuple[str, ...]:
        """Where it is driven: at its base if that is what moves."""
        return ("BASE:+X",) if self.excitation == "acceleration" else PLACE

    @property
    def model(self) -> ModalModel:
        """The linear part, as a lab with a perfect modal test believes it."""
        omega, zeta = 2 * np.pi * self.frequency, self.damping
        pole = omega * complex(-zeta, np.sqrt(1 - zeta**2))
        left = np.array([[1 / (2j * pole.imag * self.mass)]])
        return ModalModel(np.array([pole]), np.ones((1, 1), dtype=complex), left, PLACE, self.driven)

    def forces(self, level: float, seconds: float, seed: int) -> Real:
        """Random force without anything above 2.5 times the natural frequency, (n,)."""
        n = int(seconds * self.rate)
        spectrum = np.fft.rfft(np.random.default_rng(seed).normal(size=n))
        axis = np.fft.rfftfreq(n, 1 / self.rate)
        spectrum[(axis > 2.5 * self.frequency) | (axis < 0.2 * self.frequency)] = 0
        force = np.fft.irfft(spectrum, n=n)
        return np.asarray(level * force / force.std())

    def motion(self, force: Real) -> tuple[Real, Real, Real]:
        """Deflection, velocity and acceleration from rest, (n,) each, by the classical Runge-Kutta method."""
        n, fine, m, k, k3 = len(force), 16, self.mass, self.stiffness, self.cubic
        c, h = 2 * self.damping * np.sqrt(k * m), 1 / (8 * self.rate)
        pushed = (np.fft.irfft(np.fft.rfft(force), n=fine * n) * fine).tolist() + [0.0, 0.0]
        x, v, result = 0.0, 0.0, np.empty((n, 2))
        for j in range(8 * n):
            if j % 8 == 0:
                result[j // 8] = x, v
            f0, f1, f2 = pushed[2 * j], pushed[2 * j + 1], pushed[2 * j + 2]
            a0 = (f0 - c * v - k * x - k3 * x**3) / m
            x1, v1 = x + h / 2 * v, v + h / 2 * a0
            a1 = (f1 - c * v1 - k * x1 - k3 * x1**3) / m
            x2, v2 = x + h / 2 * v1, v + h / 2 * a1
            a2 = (f1 - c * v2 - k * x2 - k3 * x2**3) / m
            x3, v3 = x + h * v2, v + h * a2
            a3 = (f2 - c * v3 - k * x3 - k3 * x3**3) / m
            x, v = x + h / 6 * (v + 2 * v1 + 2 * v2 + v3), v + h / 6 * (a0 + 2 * a1 + 2 * a2 + a3)
        x_, v_ = result.T
        return x_, v_, (force - c * v_ - k * x_ - k3 * x_**3) / m

    def stiffened(self, share: float, level: float) -> "Rig":
        """The rig whose cubic spring adds a share of the stiffness at the linear motion's root mean square."""
        x = replace(self, cubic=0.0).motion(self.forces(level, 20.0, 99))[0]
        return replace(self, cubic=share * self.stiffness / (3 * float(np.mean(x**2))))

    def recording(self, name: str, force: Real, noise: float = 0.01, seed: int = 0) -> BandRecording:
        """Force and response with white noise of a share of the response."""
        x, v, a = self.motion(force)
        shown = {0: x, 1: v, 2: a}[_ORDERS[self.response]]
        shown = shown + noise * shown.std() * np.random.default_rng(1000 + seed).normal(size=len(shown))
        channels = channels_of(self.excitation, self.driven, ["drive"]), channels_of(self.response, PLACE, ["answer"])
        return BandRecording(name, self.rate, force[:, None], shown[:, None], *channels)

    def recordings(self, levels: tuple[float, ...], seconds: float = 30.0) -> list[BandRecording]:
        """One recording a level, weakest first."""
        return [
            self.recording(f"level_{k + 1}", self.forces(level, seconds, k), seed=k) for k, level in enumerate(levels)
        ]


_ORDERS = {"displacement": 0, "angle": 0, "velocity": 1, "angular_velocity": 1, "acceleration": 2, "voltage": 0}


def steady(rig: Rig, name: str, level: float, seed: int) -> BandRecording:
    """Eight periods of a multisine of 2 to 22 Hz, once the rig has settled."""
    rng = np.random.default_rng(seed)
    spectrum = np.zeros(PERIOD // 2 + 1, dtype=complex)
    lines = np.arange(round(2 * PERIOD / rig.rate), round(22 * PERIOD / rig.rate))
    spectrum[lines] = np.exp(2j * np.pi * rng.random(len(lines)))
    period = np.fft.irfft(spectrum, n=PERIOD)
    single = rig.recording(name, np.tile(level * period / period.std(), PERIODS + 2), NOISE, seed)
    return replace(single, force=single.force[2 * PERIOD :], response=single.response[2 * PERIOD :])


def written(folder: Path, recording: BandRecording) -> Path:
    """A recording as a file."""
    path = folder / f"{recording.name}.h5"
    channels = (*recording.excitations, *recording.responses)
    with RecordingWriter(path, [StreamDescription("main", recording.rate, 0.0, channels)]) as writer:
        writer.append("main", np.hstack([recording.force, recording.response]))
    return path
