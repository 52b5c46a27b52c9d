"""The methods of published listings, written anew, on the parameters these share, against millfrf's multipliers.

T. Insperger & G. Stepan, Updated semi-discretization method for periodic delay-differential equations with discrete
delay, Int. J. Numer. Methods Eng. 61 (2004) 117-141; Y. Ding, L. Zhu, X. Zhang & H. Ding, A full-discretization method
for prediction of milling stability, Int. J. Mach. Tools Manuf. 50 (2010) 502-509. The listings were read in the
repository leekunhwee/Dynamics (``OneDOFMilling.m``, ``FulldisOneDOFMilling.m``): 922 Hz, 0.011, 0.03993 kg, 6e8 and
2e8 N/m^2, two teeth, k = 40 steps of the tooth's period. They print no multipliers; what is compared is what they
compute: ``x' = A x + B(t) (x - x(t - T))``.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from benchmarks_of_literature import RPM, benchmark_cut, one_degree_of_freedom
from numpy.typing import NDArray
from scipy.linalg import expm

from millfrf.stability import multipliers

Real = NDArray[np.float64]
FREQUENCY, DAMPING, MASS, TANGENTIAL, NORMAL = 2 * math.pi * 922, 0.011, 0.03993, 6e8, 2e8
FREE = np.array([[0.0, 1.0], [-(FREQUENCY**2), -2 * DAMPING * FREQUENCY]])


def cutting(angle: float, cut: tuple[float, str], depth: float) -> float:
    """Cutting stiffness over mass at the angle of one tooth; the other is at most at the edge of the cut."""
    process = benchmark_cut(*cut)
    angle %= math.pi
    if not process.start_angle <= angle <= process.exit_angle:
        return 0.0
    return depth / MASS * math.sin(angle) * (TANGENTIAL * math.cos(angle) + NORMAL * math.sin(angle))


Stiffness = Callable[[float], float]
"""Cutting stiffness over mass along a step, whose parts run from 0 to 1."""
Step = Callable[[Stiffness, float], tuple[Real, Real, Real, Real]]


def semi_discretisation(stiffness: Stiffness, h: float) -> tuple[Real, Real, Real, Real]:
    """Constant coefficients, and a delayed position that is the mean of two: factors of now, next and the two past."""
    mean = np.mean([stiffness((i + 0.5) / 20) for i in range(20)])
    now = FREE - np.array([[0.0, 0.0], [mean, 0.0]])
    advance = expm(now * h)
    half = (advance - np.eye(2)) @ np.linalg.inv(now) @ np.array([[0.0, 0.0], [mean / 2, 0.0]])
    return advance, np.zeros((2, 2)), half, half


NODES, WEIGHTS = (points / 2 for points in np.polynomial.legendre.leggauss(6))


def full_discretisation(stiffness: Stiffness, h: float) -> tuple[Real, Real, Real, Real]:
    """Free motion that is exact; coefficients, position and delayed position that are linear over the step."""
    now, then = np.zeros((2, 2)), np.zeros((2, 2))
    for node, weight in zip(NODES + 0.5, WEIGHTS, strict=True):
        line = (1 - node) * stiffness(0.0) + node * stiffness(1.0)
        force = weight * h * expm(FREE * (1 - node) * h) @ np.array([[0.0, 0.0], [line, 0.0]])
        now, then = now - (1 - node) * force, then - node * force
    return expm(FREE * h) + now, then, -now, -then


def along_a_step(k: int, steps: int, cut: tuple[float, str], depth: float, part: float) -> float:
    """``cutting`` at a part of step k."""
    return cutting((k + part) * math.pi / steps, cut, depth)


def spectral_radius(step: Step, steps: int, cut: tuple[float, str], rpm: float, depth: float) -> float:
    """Largest multiplier of a tooth's period that is cut into steps."""
    h = math.pi / (rpm * RPM) / steps
    state, past = np.eye(2, 2 + 2 * steps), np.eye(2 * steps, 2 + 2 * steps, 2).reshape(steps, 2, -1)
    past = np.concatenate([past, state[None]])
    for k in range(steps):
        stiffness = partial(along_a_step, k, steps, cut, depth)
        now, ahead, old, after = step(stiffness, h)
        state = np.linalg.solve(np.eye(2) - ahead, now @ state + old @ past[0] + after @ past[1])
        past = np.concatenate([past[1:], state[None]])
    return float(np.abs(np.linalg.eigvals(np.vstack([state, past[:-1].reshape(2 * steps, -1)]))).max())


@pytest.mark.parametrize("step", [semi_discretisation, full_discretisation])
@pytest.mark.parametrize(("rpm", "depth"), [(20000, 2e-3), (6000, 0.35e-3)])
def test_a_slot(step: Step, rpm: float, depth: float) -> None:
    """Both are of second order: with 40 steps up to 2.7 % off, and extrapolated as millfrf to 2e-5."""
    exact = multipliers(one_degree_of_freedom(), benchmark_cut(1.0, "slot"), rpm * RPM, depth).spectral_radius
    forty, eighty, twice = (spectral_radius(step, steps, (1.0, "slot"), rpm, depth) for steps in (40, 80, 160))
    assert (forty - eighty) / (eighty - twice) == pytest.approx(4, abs=0.15)
    assert (4 * twice - eighty) / 3 == pytest.approx(exact, rel=2e-5)


@pytest.mark.parametrize(("side", "rpm", "depth"), [("up", 6000, 0.3e-3), ("down", 10000, 2e-3)])
def test_half_immersion(side: str, rpm: float, depth: float) -> None:
    """Entry and exit lie between the steps."""
    cut = (0.5, side)
    exact = multipliers(one_degree_of_freedom(), benchmark_cut(*cut), rpm * RPM, depth).spectral_radius
    eighty, twice = (spectral_radius(semi_discretisation, steps, cut, rpm, depth) for steps in (80, 160))
    assert (4 * twice - eighty) / 3 == pytest.approx(exact, rel=2e-5)
    assert spectral_radius(full_discretisation, 160, cut, rpm, depth) == pytest.approx(exact, rel=1e-3)
