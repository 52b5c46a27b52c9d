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
    """Cutting stiffness over mass; both teeth, of which one is in the cut."""
    process = benchmark_cut(*cut)
    angle %= math.pi
    if not process.start_angle <= angle <= process.exit_angle:
        return 0.0
    return depth / MASS * math.sin(angle) * (TANGENTIAL * math.cos(angle) + NORMAL * math.sin(angle))


Step = Callable[[Callable[[float], float], float], tuple[Real, Real, Real, Real]]


def semi_discretisation(stiffness: Callable[[float], float], h: float) -> tuple[Real, Real, Real, Real]:
    """Constant coefficients, and a delayed position that is the mean of two: factors of now, next and the two past."""
    mean = np.mean([stiffness((i + 0.5) / 20) for i in range(20)])
    now = FREE - np.array([[0.0, 0.0], [mean, 0.0]])
    advance = expm(now * h)
    half = (advance - np.eye(2)) @ np.linalg.inv(now) @ np.array([[0.0, 0.0], [mean / 2, 0.0]])
    return advance, np.zeros((2, 2)), half, half


NODES, WEIGHTS = (points / 2 for points in np.polynomial.legendre.leggauss(6))


def full_discretisation(stiffness: Callable[[float], float], h: float) -> tuple[Real, Real, Real, Real]:
    """Free motion that is exact; coefficients, position and delayed position that are linear over the step."""
    now, then = np.zeros((2, 2)), np.zeros((2, 2))
    for node, weight in zip(NODES + 0.5, WEIGHTS, strict=True):
        line = (1 - node) * stiffness(0.0) + node * stiffness(1.0)
        force = weight * h * expm(FREE * (1 - node) * h) @ np.array([[0.0, 0.0], [line, 0.0]])
        now, then = now - (1 - node) * force, then - node * force
    return expm(FREE * h) + now, then, -now, -then


def spectral_radius(step: Step, steps: int, cut: tuple[float, str], rpm: float, depth: float) -> float:
    """Largest multiplier of a tooth's period that is cut into steps."""
    h = math.pi / (rpm * RPM) / steps
    state, past = np.eye(2, 2 + 2 * steps), np.eye(2 * steps, 2 + 2 * steps, 2).reshape(steps, 2, -1)
    past = np.concatenate([past, state[None]])
    for k in range(steps):
        width = math.pi / steps
        now, then, old, next_old = step(lambda part, k=k: cutting((k + part) * width, cut, depth), h)
        state = np.linalg.solve(np.eye(2) - then, now @ state + old @ past[0] + next_old @ past[1])
        past = np.concatenate([past[1:], state[None]])
    return float(np.abs(np.linalg.eigvals(np.vstack([state, past[:-1].reshape(2 * steps, -1)]))).max())
