"""The update of a robot: all its numbers together, with a verdict that obeys the error on what was left out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..spatial import SpatialRobot
from .belief import sought, without_doubtful_parts
from .held_out import LeftOut, left_out
from .misfit import misfit_of, problem_of
from .naming import names_of, told_numbers
from .next_posture import NextPosture, next_posture
from .posed_receptance import PosedReceptance
from .response import UpdateParameter, free_parameters
from .told_apart import OpenDirection, open_directions

Real = NDArray[np.float64]

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
