"""A small structure with close modes, milling-like forces, and recordings of it with or without a concealed law."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from estimation import BandRecording, channels_of
from modal_fit import ModalModel

Real = NDArray[np.float64]
LABELS = ("TCP:+X", "TCP:+Y")
FORCES = channels_of("force", LABELS, ("fx", "fy"))
MOTIONS = channels_of("acceleration", LABELS, ("ax", "ay"))
RATE = 256.0


def structure() -> ModalModel:
    """Two modes in a plane, 9 and 14 Hz, 3 and 4 % damped."""
    poles, right, left = [], [], []
    for frequency, damping, mass, shape in ((9.0, 0.03, 40.0, [1.0, 0.35]), (14.0, 0.04, 30.0, [-0.4, 1.0])):
        omega = 2 * np.pi * frequency
        pole = omega * (-damping + 1j * np.sqrt(1 - damping**2))
        poles.append(pole)
        right.append(np.array(shape) / (2j * pole.imag * mass))
        left.append(np.array(shape) + 0j)
    return ModalModel(np.array(poles), np.array(right), np.array(left), LABELS, LABELS)


def forces(rng: np.random.Generator, level: float, duration: float) -> Real:
    """Sweeping tooth passings over broad noise, band-limited so that samples tell everything."""
    n = int(duration * RATE)
    time = np.arange(n) / RATE
    sweep = 2 * np.pi * (5 * time + 15 / duration * time**2 / 2)
    columns = []
    for _ in LABELS:
        spectrum = np.fft.rfft(rng.normal(size=n))
        spectrum[np.fft.rfftfreq(n, 1 / RATE) > 60] = 0
        columns.append(np.sin(sweep + rng.uniform(0, 6)) + np.fft.irfft(spectrum, n=n))
    return level * np.column_stack(columns)


Law = Callable[[float, float], float]


@dataclass(frozen=True)
class Concealed:
    """A law along a direction, integrated independently of the package by an adaptive Runge-Kutta method."""

    law: Law
    direction: Real

    def acceleration(self, model: ModalModel, force: Real) -> Real:
        n = len(force)
        time = np.arange(n) / RATE
        fine = np.fft.irfft(np.fft.rfft(force, axis=0), n=8 * n, axis=0) * 8
        step = 1 / (8 * RATE)
        d = self.direction

        def slope(at: float, state: NDArray[np.complex128]) -> NDArray[np.complex128]:
            place = at / step
            k = min(int(place), 8 * n - 2)
            here = fine[k] + (place - k) * (fine[k + 1] - fine[k])
            x = 2 * np.real(state @ model.right)
            v = 2 * np.real((state * model.poles) @ model.right)
            return np.asarray(model.poles * state + model.left @ (here - d * self.law(float(d @ x), float(d @ v))))

        answer = solve_ivp(
            slope, (0, time[-1]), np.zeros(len(model.poles), complex), t_eval=time, rtol=1e-6, atol=1e-10, max_step=2e-3
        )
        states = answer.y.T
        x, v = 2 * np.real(states @ model.right), 2 * np.real((states * model.poles) @ model.right)
        outer = force - np.array([self.law(float(a), float(b)) for a, b in zip(x @ d, v @ d, strict=True)])[:, None] * d
        return np.asarray(2 * np.real((states * model.poles**2 + (outer @ model.left.T) * model.poles) @ model.right))


def trial(name: str, force: Real, acceleration: Real, rng: np.random.Generator, noise: float = 0.02) -> BandRecording:
    """A recording with white noise: a share of each response, half of it on forces."""
    noisy_force = force + rng.normal(size=force.shape) * force.std(axis=0) * noise / 2
    noisy = acceleration + rng.normal(size=acceleration.shape) * acceleration.std(axis=0) * noise
    return BandRecording(name, RATE, noisy_force, noisy, FORCES, MOTIONS)


def linear_acceleration(model: ModalModel, force: Real) -> Real:
    """Response of the linear structure at rest before, by a padded Fourier transform."""
    n = len(force)
    frequencies = np.fft.rfftfreq(2 * n, 1 / RATE)
    spectrum = np.einsum("kpq,kq->kp", model.receptance(frequencies), np.fft.rfft(force, n=2 * n, axis=0))
    return np.asarray(np.fft.irfft(-((2 * np.pi * frequencies[:, None]) ** 2) * spectrum, n=2 * n, axis=0)[:n])


def late(response: Real, rate: float, delay: float) -> Real:
    """The response ``delay`` seconds later, by a padded Fourier transform."""
    n = 2 * len(response)
    shift = np.exp(-2j * np.pi * np.fft.rfftfreq(n, 1 / rate) * delay)[:, None]
    return np.asarray(np.fft.irfft(np.fft.rfft(response, n=n, axis=0) * shift, n=n, axis=0)[: len(response)])
