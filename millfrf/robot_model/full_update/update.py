"""Update of all uncertain numbers of a robot together, judged on held-out measurements."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import InputError, Real

from ..spatial.spatial_robot import SpatialRobot
from .belief import (
    LEAST_OFF,
    Belief,
    NextPosture,
    added_parts,
    covariance_of,
    descended,
    next_posture,
    sought,
    without_doubtful_parts,
)
from .changed_structure import UpdateParameter, free_parameters, unnamed_parameters
from .misfit import Problem, misfit_of, problem_of, sums_at, weighed
from .posed_receptance import PosedReceptance

LEFT_OPEN = 0.5
"""A direction is open where its standard deviation is still above this share of the belief before."""

SHARE = 0.35
"""Size of a parameter's part in a direction from which it is mentioned."""


@dataclass(frozen=True)
class OpenDirection:
    """A combination of numbers that the postures leave open.

    Parameters
    ----------
    names
        Numbers that take part, largest first.
    parts
        Their parts in the unit vector, in units of the beliefs before.
    left : float
        Standard deviation after over that before, along the direction.
    """

    names: tuple[str, ...]
    parts: tuple[float, ...]
    left: float

    @property
    def sentence(self) -> str:
        """The same in words."""
        share = f"{100 * self.left:.0f} % of the belief before is left"
        if len(self.names) == 1:
            return f"cannot tell {self.names[0]} here ({share})"
        listed = ", ".join(self.names[:-1]) + f" and {self.names[-1]}"
        return f"cannot tell {listed} apart here ({share})"


def open_directions(parameters: Sequence[UpdateParameter], covariance: Real) -> tuple[OpenDirection, ...]:
    """Eigenvectors of ``D^-1 C D^-1``, D the beliefs' spreads, with a root eigenvalue above :data:`LEFT_OPEN`.

    Parameters
    ----------
    covariance : (n_parameters, n_parameters)
        Covariance after the measurements.
    """
    spread = np.array([one.spread for one in parameters])
    values, vectors = np.linalg.eigh(covariance / np.outer(spread, spread))
    found = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value < LEFT_OPEN**2:
            break
        order = [i for i in np.argsort(-np.abs(vector)) if abs(vector[i]) > SHARE]
        names = tuple(parameters[i].name for i in order)
        found.append(OpenDirection(names, tuple(float(vector[i]) for i in order), float(np.sqrt(value))))
    return tuple(found)


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
    threshold = float(scipy.stats.norm.isf(SIGNIFICANCE / (2 * n)))
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


NOISE = 1.2
"""Error on what was left out, over the expected one, up to which an update explains it."""

HALF = 0.5
"""Share of the squared error beyond noise that an update may leave and still explain partly."""


@dataclass(frozen=True)
class RobotUpdate:
    """An update of a robot's numbers by what was measured.

    Parameters
    ----------
    parameters
        Numbers that were freed.
    x : (n_parameters,)
        Their differences from the file, in the parameters' units; logarithms for stiffnesses, links and damping.
    covariance : (n_parameters, n_parameters)
        Covariance of x; widened by what is left where the update explains partly.
    told : (n_parameters,), bool
        Whether the measurements tell the number.
    named : (n_parameters,), bool
        Whether the number in the file is surely wrong.
    verdict
        ``none``, ``explained``, ``partly explained`` or ``unexplained``.
    reason
        The verdict in a sentence.
    held_out
        Errors on what was left out.
    fitted : (n_postures,)
        Errors on what was fitted, in units of the noise.
    noise, modes_off
        Size of the noise over what was stated; standard deviation of modes' relative frequency about the robot's.
    open
        Combinations that the postures leave open.
    next
        Posture to measure next, or None.
    """

    parameters: tuple[UpdateParameter, ...]
    x: Real
    covariance: Real
    told: NDArray[np.bool_]
    named: NDArray[np.bool_]
    verdict: str
    reason: str
    held_out: tuple[LeftOut, ...]
    fitted: Real
    noise: float
    modes_off: float
    open: tuple[OpenDirection, ...]
    next: NextPosture | None

    @property
    def errors(self) -> Real:
        """Standard errors, (n_parameters,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers that are surely wrong in the file."""
        return tuple(one.name for one, named in zip(self.parameters, self.named, strict=True) if named)


def update_robot(
    robot: SpatialRobot,
    measured: Sequence[PosedReceptance],
    poses: Mapping[str, Real] | None = None,
    *,
    plan: bool = True,
    progress: Callable[[str], None] | None = None,
) -> RobotUpdate:
    """Update all numbers of a robot together by FRFs and modal models at one posture or more.

    Minimises ``sum r^T (s^2 I + t^2 G G^T)^-1 r + sum x^2 / spread^2`` over the differences x: whitened errors r, the
    belief that modes may be off by t in each posture (G), and the belief about x. s and t are the most probable ones.

    Parameters
    ----------
    robot
        The robot as its file has it.
    measured
        What was measured, each in its posture.
    poses
        Postures of the file, driven values, that may be measured next; None: random ones only.
    plan
        Whether a posture to measure next is sought.
    progress
        Callable that is told what is being done.

    Raises
    ------
    InputError
        Nothing was measured, or a robot without masses.
    """
    if not measured:
        raise InputError("an update needs at least one measurement; give FRFs, modal models or recordings")
    say = progress or (lambda _: None)
    parameters = free_parameters(robot)
    problem = problem_of(robot, parameters, measured)
    say("fitting all numbers together")
    found = without_doubtful_parts(problem, sought(problem))
    say("leaving postures out")
    held = left_out(problem, found)
    fitted = np.array([misfit_of(problem, i, found.x) for i in range(len(problem.postures))])
    named, _ = names_of(robot, problem, found, held)
    verdict, reason = _verdict(held, fitted, bool(named.any()))
    say("weighing postures to measure next")
    following = next_posture(robot, poses or {}, problem, found) if plan else None
    told = told_numbers(parameters, found)
    worst = max([1.0, *(one.after for one in held)])
    wider = found.covariance if verdict in ("none", "explained") else found.covariance * worst**2
    sure = named if verdict == "explained" else np.zeros_like(named)
    x = found.x if verdict != "unexplained" else np.zeros_like(found.x)
    return RobotUpdate(
        parameters,
        x,
        wider,
        told,
        sure,
        verdict,
        reason,
        held,
        fitted,
        float(np.sqrt(found.scale)),
        found.modes_off,
        open_directions(parameters, found.covariance),
        following,
    )


def _verdict(held: Sequence[LeftOut], fitted: Real, named: bool) -> tuple[str, str]:
    if not held:
        return (
            "partly explained",
            "one modal model alone leaves nothing to check the update on; measure a second posture",
        )
    before, after = np.array([one.before for one in held]), np.array([one.after for one in held])
    allowed = NOISE * np.array([one.expected for one in held])
    if before.max() <= NOISE and not named:
        return "none", "the robot's file predicts the measurements to their noise: nothing is wrong that they show"
    worse = [one.name for one in held if one.after > max(one.before, NOISE)]
    left, was = np.sum(np.maximum(after**2 - 1, 0)), np.sum(np.maximum(before**2 - 1, 0))
    # what a posture left out leaves open may be granted; nothing is open where it was fitted
    if (after <= allowed).all() and fitted.max() <= NOISE and not worse:
        return "explained", "the updated robot predicts every posture that was left out to the noise"
    if not worse and left <= HALF * was:
        return "partly explained", (
            f"the updated robot predicts what was left out to {after.max():.3g} times the noise (before: "
            f"{before.max():.3g}): better, but something is wrong that none of the numbers stands for"
        )
    what = f"raises the error on {', '.join(worse)}" if worse else f"leaves {100 * left / max(was, 1e-300):.0f} % of it"
    return "unexplained", (
        f"the update {what} when left out: what is wrong is none of the numbers that are freed, or cannot be told here"
    )
