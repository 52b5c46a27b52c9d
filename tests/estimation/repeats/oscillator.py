"""An oscillator with known truth, many cases at once: linear, quadratic or cubic spring, periodic force."""

import numpy as np
from numpy.typing import NDArray

from estimation import BandRecording, channels_of

Real = NDArray[np.float64]

RATE = 512.0
PERIOD = 512
NATURAL, DAMPING = 40.0, 0.05
CHANNELS = channels_of("force", ["P:+X"], ["fx"]), channels_of("displacement", ["P:+X"], ["x"])
INNER = 8
"""Steps of the integration a sample."""


def multisine(seed: int, lines: NDArray[np.int64], period: int = PERIOD) -> Real:
    """One period of a multisine of random phases with a root mean square of one, (period,)."""
    spectrum = np.zeros(period // 2 + 1, dtype=complex)
    spectrum[lines] = np.exp(2j * np.pi * np.random.default_rng(seed).random(len(lines)))
    signal = np.fft.irfft(spectrum)
    return np.asarray(signal / signal.std())


def motion(force: Real, cubic: float = 0.0, quadratic: float = 0.0) -> Real:
    """Displacement (n_samples, n_cases) from rest under forces (n_samples, n_cases), in units of the static one.

    ``x'' / w^2 + 2 zeta x' / w + x + quadratic x^2 + cubic x^3 = f``, leapfrog with eight steps a sample; the force is
    linear in between.
    """
    w, step = 2 * np.pi * NATURAL, 1 / RATE / INNER
    x, v = np.zeros(force.shape[1]), np.zeros(force.shape[1])
    out = np.empty_like(force)
    for n in range(len(force)):
        out[n] = x
        slope = (force[min(n + 1, len(force) - 1)] - force[n]) / INNER
        for inner in range(INNER):
            spring = x + quadratic * x**2 + cubic * x**3
            push = w**2 * (force[n] + inner * slope - spring)
            v = ((1 - DAMPING * w * step) * v + step * push) / (1 + DAMPING * w * step)
            x = x + step * v
    return out


def steady(period: Real, n_periods: int, run_in: int = 3, **law: float) -> tuple[Real, Real]:
    """Force and displacement (n_periods * PERIOD, n_cases) once the oscillator has settled; ``period`` (PERIOD, n)."""
    force = np.tile(period, (n_periods + run_in, 1))
    return force[run_in * len(period) :], motion(force, **law)[run_in * len(period) :]


def recording(name: str, force: Real, response: Real) -> BandRecording:
    """One case (n_samples,) as a recording."""
    return BandRecording(name, RATE, force[:, None], response[:, None], *CHANNELS)


def noisy(name: str, force: Real, response: Real, levels: tuple[float, float], seed: int) -> BandRecording:
    """The same with white noise of the standard deviations ``levels`` on force and response."""
    rng = np.random.default_rng(seed)
    return recording(
        name, force + levels[0] * rng.normal(size=len(force)), response + levels[1] * rng.normal(size=len(force))
    )
