"""How well an updated robot predicts what was left out of its update: a posture, or lines of the only one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .belief import LEAST_OFF, Belief, added_parts, covariance_of, descended
from .misfit import Problem, misfit_of, sums_at

Real = NDArray[np.float64]

MOST_EXPECTED = 1.2
"""Error over the noise that is granted at most for what an update left open."""

BLOCKS = 8
"""Blocks of lines into which the only posture is cut; every second one is left out."""


@dataclass(frozen=True)
class LeftOut:
    """Error on one measurement that was left out, in units of its noise: 1 is the noise alone.

    Parameters
    ----------
    name
        Name of the measurement.
    before, after
        Error of the robot as its file has it, and as updated without this measurement.
    expected
        Error that a right robot would show: the noise, what the update left open in this posture, and the least that
        modes are off; at most a fifth more than the noise.
    x : (n_parameters,)
        Numbers of that update.
    """

    name: str
    before: float
    after: float
    expected: float
    x: Real


def left_out(problem: Problem, found: Belief) -> tuple[LeftOut, ...]:
    """Leave out each posture in turn; of a single FRF, every second block of lines. Empty for one modal model."""
    if len(problem.postures) > 1:
        held = _at_zero(problem, found)
        results = []
        for i, (measured, _) in enumerate(problem.postures):
            x, _ = descended(problem.without(i), found.x, found.scale, found.modes_off, held)
            results.append(_judged(problem.without(i), problem.only(i), found, measured.name, x))
        return tuple(results)
    measured, system = problem.postures[0]
    if measured.projection is not None:
        return ()
    block = np.arange(len(measured.frequencies)) * BLOCKS // len(measured.frequencies)
    results = []
    for side in (0, 1):
        parts = [Problem(problem.parameters, ((measured.part(block % 2 == s), system),)) for s in (side, 1 - side)]
        x, _ = descended(parts[0], found.x, found.scale, found.modes_off, _at_zero(problem, found))
        name = f"{measured.name}, half {side + 1} of the lines"
        results.append(_judged(parts[0], parts[1], found, name, x))
    return tuple(results)


def _at_zero(problem: Problem, found: Belief) -> NDArray[np.bool_]:
    """Parts that the update did not add stay away."""
    return np.asarray(added_parts(problem.parameters) & (found.x == 0))


def _judged(fitted: Problem, left: Problem, found: Belief, name: str, x: Real) -> LeftOut:
    """Error on what is left, beside the one that ``1 + (tr(F C) + t^2 tr(G^T G)) / n`` lets expect."""
    covariance = covariance_of(fitted, sums_at(fitted, x), found.scale, found.modes_off)
    sums = sums_at(left, x)[0]
    spread = float(np.trace(sums.jj @ covariance)) + LEAST_OFF**2 * float(np.trace(sums.gg))
    expected = min(float(np.sqrt(1 + spread / sums.count)), MOST_EXPECTED)
    return LeftOut(name, misfit_of(left, 0, np.zeros_like(x)), misfit_of(left, 0, x), expected, x)
