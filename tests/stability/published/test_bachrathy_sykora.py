"""A chart of D. Bachrathy & H. T. Sykora, Multiplication-free stochastic semi-discretization (submitted, JSV).

Up-milling with two teeth, a quarter of the pitch in the cut, equal modes in X and Y, at a constant speed and at one
that varies by 25 % ten revolutions long: ``q'' + 2 z q' + q = -w H(t) (q - q(t - tau))``. Equation, parameters and
curves were read in the repository bachrathyd/StochasticSemiDiscretizationMethod.jl, commit 34ddd142, ``benchmark/``:
``ssv2dof_chart.jl``, ``ssv2_mdbm_cs_det.csv`` and ``ssv2_mdbm_ssv_det.csv``.

**The files disagree with the equation.** Up to 66 % apart from its limits (an independent solution agrees with
millfrf), they are those of the transposed matrix H, in which the directions of chip and force are exchanged; the
scripts beside them have the printed H, so that the files may be older. For equal modes a non-reciprocal structure has
the same limits: with the chip c and the force ``-M c``, M constant, ``c . H(w) M c`` becomes ``c . H(w) M^T c`` by
``H M^T M^-1`` for H.
"""

import math

import numpy as np
import pytest
from benchmarks_of_literature import oscillators
from independent_floquet import Mill, spectral_radius
from numpy.typing import NDArray

from millfrf.cutting import MillingProcess
from millfrf.stability import SpeedVariation, collocation, varied_speed_limits
from modal_fit import ModalModel

Real = NDArray[np.float64]
NATURAL, DAMPING, RADIAL, AMPLITUDE, TURNS = 2 * np.pi * 100, 0.02, 0.3, 0.25, 10
TEETH, LEAVE = 2, math.pi / 4
# natural frequencies in a radian of the spindle's turn, and depth in stiffness over ktc: 1 mm here
CURVE = [
    (0.12958, 0.8039), (0.13564, 0.4984), (0.15347, 0.8664), (0.1731, 1.0937), (0.19287, 0.4798), (0.2374, 1.605),
    (0.2568, 1.5086), (0.27607, 0.6508), (0.33104, 0.3495), (0.33857, 0.225), (0.34765, 0.4691), (0.39697, 1.4912),
    (0.51372, 2.9404), (0.54963, 1.2186), (0.58331, 0.7935), (0.91535, 0.4857), (1.03837, 0.371), (1.32997, 0.7599),
]  # fmt: skip
PROCESS = MillingProcess(TEETH, 0.02, math.pi / 2, 1e9, RADIAL, 0.0, 0.0, LEAVE, 1e-4)


def structure(*, swapped: bool) -> ModalModel:
    """The equal modes; ``swapped``: with the limits of the transposed matrix."""
    model = oscillators([(NATURAL / 2 / np.pi, DAMPING, 1e6, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))])
    turned = np.array([[RADIAL, 1.0, 0.0], [-1.0, RADIAL, 0.0], [0.0, 0.0, 1.0]])
    left = model.left @ turned.T @ np.linalg.inv(turned) if swapped else model.left
    return ModalModel(model.poles, model.right, left, model.responses, model.excitations)


def test_the_chart_at_constant_speed_is_that_of_the_transposed_matrix() -> None:
    """Lobes of Hopf bifurcation, and a notch of period doubling at three of the speeds.

    The file has 24 steps of the delay, or 30 of an oscillation, in which entry and exit fall inside of steps: 2.5 %.
    """
    speeds, depths = np.array(CURVE).T
    lobes = collocation(structure(swapped=True), PROCESS, speeds * NATURAL, 4e-3)
    np.testing.assert_allclose(lobes.depth_limits * 1e3, depths, rtol=0.025)
    doubled = [speed for speed, kind in zip(speeds, lobes.bifurcations, strict=True) if kind == "period-doubling"]
    assert doubled == [0.33104, 0.33857, 0.34765]


@pytest.mark.parametrize(("speed", "published"), [(0.2374, 1.605), (0.33857, 0.225), (0.1731, 1.0937)])
def test_the_printed_equation_has_other_limits(speed: float, published: float) -> None:
    """Judged by Gauss's rule on the force equations: the limit of millfrf is one, that of the file is not."""
    model = structure(swapped=False)
    [limit] = collocation(model, PROCESS, np.array([speed * NATURAL]), 4e-3).depth_limits
    assert abs(limit * 1e3 / published - 1) > 0.19
    mill = Mill(TEETH, math.pi / 2, PROCESS.ktc, RADIAL, 0.0, 0.0, LEAVE)
    below, above, there = (
        spectral_radius(model.poles, model.right, model.left, mill, speed * NATURAL, depth)
        for depth in (0.999 * limit, 1.001 * limit, published * 1e-3)
    )
    assert below < 1 < above
    assert abs(there - 1) > 0.07


def growth(speed: float, depth: float, over: str, steps: int = 100) -> float:
    """Largest multiplier over the common period, in dimensionless units: the transposed matrix, steps of the angle.

    The speed varies over ``time`` (the source) or over the spindle's ``angle`` (millfrf). Over the angle the delay is
    one pitch; the force of a step is that of its middle, and the free motion is exact.
    """
    pitch, passings = 2 * math.pi / TEETH, TEETH * TURNS
    edges = np.arange(steps * passings + 1) * pitch / steps
    if over == "angle":
        middle = (edges[1:] + edges[:-1]) / 2
        times = np.diff(edges) / (speed * (1 + AMPLITUDE * np.sin(middle / TURNS)))
    else:
        fine = np.linspace(0.0, 2 * math.pi * TURNS / speed, 200_001)
        turned = speed * fine + TURNS * AMPLITUDE * (1 - np.cos(speed * fine / TURNS))
        times = np.diff(np.interp(edges, turned, fine))
    size = 4 + 2 * steps
    state, past = np.eye(4, size), np.zeros((steps + 1, 2, size))
    past[:steps].reshape(2 * steps, size)[:, 4:] = np.eye(2 * steps)
    past[steps] = state[:2]
    damped = math.sqrt(1 - DAMPING**2)
    for step, time in enumerate(times):
        cosine, sine, decay = math.cos(damped * time), math.sin(damped * time) / damped, math.exp(-DAMPING * time)
        free = decay * np.array([[cosine + DAMPING * sine, sine], [-sine, cosine - DAMPING * sine]])
        advance, push = np.kron(free, np.eye(2)), np.kron([[1 - free[0, 0]], [-free[1, 0]]], np.eye(2))
        phi = (step + 0.5) * pitch / steps % pitch
        if phi < LEAVE:
            s, c = math.sin(phi), math.cos(phi)
            stiffness = depth * np.outer([s, c], [c + RADIAL * s, RADIAL * c - s])
            half = np.hstack([push @ stiffness / 2, np.zeros((4, 2))])
            before = push @ stiffness @ (past[0] + past[1]) / 2
            state = np.linalg.solve(np.eye(4) + half, (advance - half) @ state + before)
        else:
            state = advance @ state
        past = np.concatenate([past[1:], state[None, :2]])
    return float(np.abs(np.linalg.eigvals(np.vstack([state, past[:steps].reshape(2 * steps, size)]))).max())


VARIED = [(0.6, 0.972), (0.65, 0.712), (0.8, 0.521)]


@pytest.mark.parametrize(("speed", "published"), VARIED)
def test_the_chart_at_a_varied_speed(speed: float, published: float) -> None:
    """The source varies the speed over time: an independent integration has its limits to 2 %."""
    assert growth(speed, 0.98 * published, "time") < 1 < growth(speed, 1.02 * published, "time")


@pytest.mark.parametrize(("speed", "published"), VARIED)
def test_limits_at_a_speed_that_varies_over_the_angle(speed: float, published: float) -> None:
    """With the same period, millfrf's sine over the angle has limits within 9 % of those of a sine over time.

    The same integration, over the angle, has its limits to 1 %.
    """
    mean = speed / math.sqrt(1 - AMPLITUDE**2)
    variation = SpeedVariation(AMPLITUDE, 1 / TURNS)
    lobes = varied_speed_limits(structure(swapped=True), PROCESS, np.array([mean * NATURAL]), 4e-3, variation)
    limit = float(lobes.depth_limits[0]) * 1e3
    assert limit == pytest.approx(published, rel=0.09)
    assert growth(mean, 0.99 * limit, "angle") < 1 < growth(mean, 1.01 * limit, "angle")
