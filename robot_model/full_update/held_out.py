"""How well an updated robot predicts what was left out of its update: a posture, or lines of the only one."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .belief import Belief, added_parts, descended
from .misfit import Problem, misfit_of

Real = NDArray[np.float64]

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
    x : (n_parameters,)
        Numbers of that update.
    """

    name: str
    before: float
    after: float
    x: Real


def left_out(problem: Problem, found: Belief) -> tuple[LeftOut, ...]:
    """Leave out each posture in turn; of a single FRF, every second block of lines. Empty for one modal model."""
    if len(problem.postures) > 1:
        held = _at_zero(problem, found)
        results = []
        for i, (measured, _) in enumerate(problem.postures):
            x, _ = descended(problem.without(i), found.x, found.scale, found.modes_off, held)
            results.append(_judged(problem, i, measured.name, x))
        return tuple(results)
    measured, system = problem.postures[0]
    if measured.projection is not None:
        return ()
    block = np.arange(len(measured.frequencies)) * BLOCKS // len(measured.frequencies)
    results = []
    for side in (0, 1):
        parts = [Problem(problem.parameters, ((measured.part(block % 2 == s), system),)) for s in (side, 1 - side)]
        x, _ = descended(parts[0], found.x, found.scale, found.modes_off, _at_zero(problem, found))
        results.append(_judged(parts[1], 0, f"{measured.name}, half {side + 1} of the lines", x))
    return tuple(results)


def _at_zero(problem: Problem, found: Belief) -> NDArray[np.bool_]:
    """Parts that the update did not add stay away."""
    return np.asarray(added_parts(problem.parameters) & (found.x == 0))


def _judged(problem: Problem, index: int, name: str, x: Real) -> LeftOut:
    return LeftOut(name, misfit_of(problem, index, np.zeros_like(x)), misfit_of(problem, index, x), x)
