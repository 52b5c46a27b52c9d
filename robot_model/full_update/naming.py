"""Which numbers of a robot's file are surely wrong: few and sure; the others are updated, not named."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

from ..spatial import SpatialRobot
from .belief import Belief, covariance_of
from .held_out import LeftOut
from .misfit import Problem, problem_of, sums_at, weighed
from .response import UpdateParameter, unnamed_parameters

Real = NDArray[np.float64]

SIGNIFICANCE = 0.005
"""Probability that a right robot gets any name (Bonferroni 1936: divided by the number of parameters)."""

TOLD = 0.5
"""A number is told where its standard error is below this share of the belief before."""

LEAST = {
    "stiffness": 0.03,
    "joint damping": 0.004,
    "damping": 0.10,
    "links": 0.05,
    "payload": 0.5,
    "tool mass": 0.3,
    "tool": 5e-9,
    "base": 5e-10,
    "inertia": np.inf,
    "sprung mass": np.inf,
}
"""Smallest difference that is named, in the parameter's unit: what is less is within what files are known to."""


def told_numbers(parameters: Sequence[UpdateParameter], found: Belief) -> NDArray[np.bool_]:
    """Whether each number is told by the measurements; a payload's place only where its mass is told and not zero."""
    spread = np.array([one.spread for one in parameters])
    told = found.errors < TOLD * spread
    for i, one in enumerate(parameters):
        if one.kind == "payload" and one.axis == 3 and not abs(found.x[i]) > 3 * found.errors[i]:
            told[[k for k, other in enumerate(parameters) if other.kind == "payload" and other.axis < 3]] = False
    sprung = any(one.kind == "tool" and value > 0 for one, value in zip(parameters, found.x, strict=True))
    return np.asarray(told & np.array([one.kind != "sprung mass" or sprung for one in parameters]))


def names_of(
    robot: SpatialRobot, problem: Problem, found: Belief, held_out: Sequence[LeftOut]
) -> tuple[NDArray[np.bool_], Real]:
    """Which numbers differ from the file beyond doubt, and the errors by which that was judged.

    A number is named if it differs by more than the Bonferroni threshold's multiple of its error, and by more than
    :data:`LEAST`. The error is the largest of three: Laplace's; Laplace's with the masses of the bodies free too; the
    jackknife's, between updates that leave one measurement out. It must pass with the masses free as well.

    Returns
    -------
    (n_parameters,), bool and (n_parameters,)
    """
    n = len(problem.parameters)
    shifted, errors = _with_masses_free(robot, problem, found)
    errors = np.maximum(np.maximum(errors, found.errors), _jackknife(held_out, n))
    threshold = float(norm.isf(SIGNIFICANCE / (2 * n)))
    least = np.array([LEAST[one.kind] for one in problem.parameters])
    named = told_numbers(problem.parameters, found)
    for x in (found.x, shifted, *(one.x for one in held_out)):
        named &= (np.abs(x) > threshold * errors) & (np.sign(x) == np.sign(found.x))
    named &= np.abs(found.x) > least
    places = [one.kind == "payload" and one.axis < 3 for one in problem.parameters]
    return named & ~np.array(places), errors


def _with_masses_free(robot: SpatialRobot, problem: Problem, found: Belief) -> tuple[Real, Real]:
    """Numbers and errors after one Gauss-Newton step with the bodies' masses free beside them."""
    n = len(problem.parameters)
    every = (*problem.parameters, *unnamed_parameters(robot))
    wider = problem_of(robot, every, [measured for measured, _ in problem.postures])
    x = np.concatenate([found.x, np.zeros(len(every) - n)])
    sums = sums_at(wider, x)
    covariance = covariance_of(wider, sums, found.scale, found.modes_off)
    gradient = weighed(sums, found.scale, found.modes_off)[1] + wider.precision * x
    shifted = x - covariance @ gradient
    return np.where(found.x == 0, 0.0, shifted[:n]), np.sqrt(np.diag(covariance))[:n]


def _jackknife(held_out: Sequence[LeftOut], n: int) -> Real:
    """Standard errors from updates that leave one measurement out (Efron & Tibshirani, chapter 11)."""
    if len(held_out) < 2:
        return np.zeros(n)
    x = np.array([one.x for one in held_out])
    return np.asarray(np.sqrt((len(x) - 1) / len(x) * np.sum((x - x.mean(axis=0)) ** 2, axis=0)))
