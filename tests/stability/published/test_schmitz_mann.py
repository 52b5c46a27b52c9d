"""Closed form of the surface location error: T. L. Schmitz & B. P. Mann, 2006.

The paper ("Closed-form solutions for surface location error in milling", International Journal of Machine Tools and
Manufacture 46, 1369-1377) was not at hand, so that its method is derived anew: Fourier coefficients of the force of one
tooth in closed form, with the lag of the helix over the depth, times the receptance across the wall, summed where the
edge passes the wall.
"""

import math

import numpy as np
import pytest
from benchmarks_of_literature import RPM, oscillators
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.stability import surface_error

NATURAL, DAMPING, STIFFNESS = 900.0, 0.02, 9e6
MODEL = oscillators([(NATURAL, DAMPING, STIFFNESS, (0.0, 1.0, 0.0))])
DEPTH, HARMONICS = 0.004, 4000
TOLERANCE = 3e-3  # of the amplitude, for the steps of a turn in which the force is computed
SPEEDS = np.array([7000.0, 9400.0, 13000.0, 17200.0, 18800.0, 21000.0])


def cut(side: str, helix: float) -> MillingProcess:
    """A fifth of the diameter with three teeth."""
    width = math.acos(1 - 2 * 0.2)
    start, leave = (0.0, width) if side == "up" else (math.pi - width, math.pi)
    return MillingProcess(3, 0.019, math.pi / 2, 6e8, 0.35, 0.0, start, leave, 1e-4, 4e3, 3e3, helix_angle=helix)


def _integral(order: NDArray[np.int64], low: float, high: float) -> NDArray[np.complex128]:
    """The integral of ``exp(i order phi)``."""
    safe = np.where(order == 0, 1, order)
    return np.where(order == 0, high - low, (np.exp(1j * safe * high) - np.exp(1j * safe * low)) / (1j * safe))


def closed_form(process: MillingProcess, rpm: float, angles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Motion along +Y, m, at angles of the tip of an edge."""
    k = process.teeth * np.arange(-HARMONICS, HARMONICS + 1)
    e = {m: _integral(m - k, process.start_angle, process.exit_angle) for m in (-2, -1, 0, 1, 2)}
    sine, cosine = (e[1] - e[-1]) / 2j, (e[1] + e[-1]) / 2
    squared, mixed = e[0] / 2 - (e[2] + e[-2]) / 4, (e[2] - e[-2]) / 4j
    pressed = process.ktc * process.feed_per_tooth
    force = pressed * (squared - process.krc * mixed) + process.kte * sine - process.kre * cosine
    lag = 2 * math.tan(process.helix_angle) / process.diameter
    phase = k * lag * DEPTH
    summed = DEPTH * np.exp(-0.5j * phase) * np.sinc(phase / (2 * np.pi))
    s, natural = 1j * k * rpm * RPM, 2 * np.pi * NATURAL
    receptance = natural**2 / STIFFNESS / (natural**2 + 2 * DAMPING * natural * s + s**2)
    lines = process.teeth / (2 * np.pi) * force * summed * receptance
    return np.array([np.sum(lines * np.exp(1j * k * angle)).real for angle in angles])


@pytest.mark.parametrize("side", ["up", "down"])
@pytest.mark.parametrize("helix", [0.0, 0.5])
def test_error_over_speed_and_height(side: str, helix: float) -> None:
    """The error counts along the outward normal of the wall: +Y for up milling and -Y for down milling."""
    process = cut(side, helix)
    computed = surface_error(MODEL, process, SPEEDS * RPM, DEPTH)
    wall, outward = (0.0, 1) if side == "up" else (math.pi, -1)
    passing = wall + 2 * computed.heights * math.tan(helix) / process.diameter
    turn = np.linspace(0, 2 * np.pi / process.teeth, 100)
    for rpm, error in zip(SPEEDS, computed.error, strict=True):
        amplitude = np.ptp(closed_form(process, rpm, turn)) / 2
        np.testing.assert_allclose(error, outward * closed_form(process, rpm, passing), atol=TOLERANCE * amplitude)
