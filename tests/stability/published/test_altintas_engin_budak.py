"""Variable pitch: the equation of Y. Altintas, S. Engin & E. Budak, J. Manuf. Sci. Eng. 121 (1999) 173-178.

The averaged coefficients of Altintas & Budak with the phase factors of the pitches, ``det[I + L A G] = 0`` and
``L = -a K / (4 pi) sum_j (1 - exp(-i w tau_j))``. The cutter of 19.05 mm with pitches of 70 and 110 deg, the modes and
the cutting coefficients were read in the repository xiaoyukun66/MillingStabilityAnalysis
(``Vari_pitch_Tool_3rdFDM_optimal.m``). It prints no limits.
"""

import math

import numpy as np
import pytest
from benchmarks_of_literature import RPM, oscillators
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.stability import nyquist_limits

Complex = NDArray[np.complex128]
TANGENTIAL, RADIAL = 697e6, 255.8 / 697  # Pa, ratio
# natural frequency (Hz), mass (kg) and damping ratio
FEED = [(441.64, 11.125, 0.028722), (563.6, 1.4986, 0.055801), (778.56, 13.063, 0.058996)]
NORMAL = [(516.21, 1.199, 0.025004)]
SPEEDS = np.array([2500.0, 3500, 5000, 7000, 9000])


def receptance(modes: list[tuple[float, float, float]], omega: NDArray[np.float64]) -> Complex:
    """Sum of oscillators."""
    terms = [
        1 / (mass * ((2 * math.pi * f) ** 2 - omega**2 + 2j * z * 2 * math.pi * f * omega)) for f, mass, z in modes
    ]
    return np.asarray(np.sum(terms, axis=0))


def average_coefficients(start: float, leave: float) -> NDArray[np.float64]:
    """Matrix A (Altintas & Budak 1995), chip in the feed X and the normal Y."""

    def primitive(phi: float) -> NDArray[np.float64]:
        s, c = math.sin(2 * phi), math.cos(2 * phi)
        return np.array(
            [
                [c - 2 * RADIAL * phi + RADIAL * s, -s - 2 * phi + RADIAL * c],
                [-s + 2 * phi + RADIAL * c, -c - 2 * RADIAL * phi - RADIAL * s],
            ]
        )

    return (primitive(leave) - primitive(start)) / 2


def closed_form(pitches: NDArray[np.float64], rpm: float) -> float:
    """Least positive depth (m) over all chatter frequencies."""
    omega = 2 * math.pi * np.linspace(50.0, 2500.0, 40_001)
    gains = np.zeros((omega.size, 2, 2), complex)
    gains[:, 0, 0], gains[:, 1, 1] = receptance(FEED, omega), receptance(NORMAL, omega)
    loop = average_coefficients(math.pi / 2, math.pi) @ gains
    trace = loop[:, 0, 0] + loop[:, 1, 1]
    root = np.sqrt(trace**2 - 4 * np.linalg.det(loop))
    phases = np.sum(1 - np.exp(-1j * np.outer(omega, pitches / (rpm * RPM))), axis=1)
    lowest = math.inf
    for eigenvalue in ((trace + root) / 2, (trace - root) / 2):
        inverse = TANGENTIAL / (4 * math.pi) * phases * eigenvalue
        near = np.abs(np.diff(inverse)) < 0.1 * np.abs(inverse[1:])  # not where the two eigenvalues change places
        k = np.flatnonzero(near & (np.diff(np.sign(inverse.imag)) != 0))
        real = inverse.real[k] - inverse.imag[k] * np.diff(inverse.real)[k] / np.diff(inverse.imag)[k]
        lowest = min([lowest, *(1 / real[real > 0])])
    return lowest


@pytest.mark.parametrize("degrees", [(90.0, 90.0, 90.0, 90.0), (70.0, 110.0, 70.0, 110.0)])
def test_limits_of_the_averaged_equation(degrees: tuple[float, ...]) -> None:
    """The search by counting unstable roots ends at 0.1 %."""
    pitches = np.radians(degrees)
    modes = [(f, z, mass * (2 * math.pi * f) ** 2, (1.0, 0.0, 0.0)) for f, mass, z in FEED]
    modes += [(f, z, mass * (2 * math.pi * f) ** 2, (0.0, 1.0, 0.0)) for f, mass, z in NORMAL]
    process = MillingProcess(
        4, 0.01905, math.pi / 2, TANGENTIAL, RADIAL, 0.0, math.pi / 2, math.pi, 1e-4, pitch_angles=tuple(pitches)
    )
    limits = nyquist_limits(oscillators(modes), process, SPEEDS * RPM, 0.05).depth_limits
    np.testing.assert_allclose(limits, [closed_form(pitches, rpm) for rpm in SPEEDS], rtol=1e-3)
