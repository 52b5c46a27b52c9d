"""Fit of a hypothesis to recordings in several postures: a few numbers of the robot, and each mode's deviation."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_model import Change

from ...inference import Limits, descend
from .fit_state import FitProblem, doubt_of
from .posed_robot import Changes, PosedRobot
from .receptance import RobotModes

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

DESCENT = Limits(most=12, tolerance=0.05, idle=1, tries=2, most_damping=10.0, lengthens=False)
"""When a fit ends: numbers of a robot are few, and their errors are wanted to a small part of themselves."""


@dataclass(frozen=True)
class RobotFit:
    """A robot with changes, fitted to recordings.

    Parameters
    ----------
    changes
        Changes and companions with their fitted numbers.
    deviations
        Deviations u of the modes of each recording, in units of the laboratory's error.
    misfit
        ``2 sum r^H V^-1 r`` over lines and recordings, with the noise covariance V known.
    deviation
        Squared deviations of all modes, ``sum |u|^2``.
    doubt
        ``sum ((number - centre) / spread)^2`` over companions whose numbers are believed to lie near a centre.
    price
        ``ln N`` for each change, and ``2 ln(spread / standard error)`` for each companion: what their freedom costs
        (Bayes' information criterion, and Laplace's approximation where a belief has a width).
    standard_errors : (n_changes,)
        Standard errors of the numbers, in their units.
    modes
        Modes in each recording's posture, deviations included.
    told
        Number of deviations that the recordings tell, ``sum 1 - belief var(u)``: the value that |u|^2 is expected
        to have.
    """

    changes: Changes
    deviations: tuple[Real, ...]
    misfit: float
    deviation: float
    doubt: float
    price: float
    standard_errors: Real
    modes: tuple[RobotModes, ...]
    told: float

    @property
    def cost(self) -> float:
        """Misfit, deviation and doubt: what the fit minimises."""
        return self.misfit + self.deviation + self.doubt

    @property
    def score(self) -> float:
        """Cost and price: what hypotheses are compared by."""
        return self.cost + self.price


def fit_robot(
    robot: PosedRobot,
    changes: Changes,
    whiteners: Sequence[Complex],
    *,
    start: Sequence[Real] | None = None,
    belief: float = 1.0,
) -> RobotFit:
    """Fit the changes' numbers and the modes' deviations: minimise ``2 sum |W r|^2 + belief |u|^2``.

    Parameters
    ----------
    robot
        The robot and its recordings.
    changes
        Changes with the numbers to start from.
    whiteners
        Whitening W of each recording, (n_lines, n_responses, n_responses).
    start
        Deviations of each recording to start from, (n_deviations,); None: zero.
    belief
        Precision of the belief that u is zero: 1, or little to fit the modes freely.
    """
    problem = FitProblem(robot, tuple(whiteners), belief)
    state = descend(problem, problem.state(changes, start), DESCENT).state
    matrix, _ = state.normal
    deviation, doubt = float(sum(u @ u for u in state.deviations)), doubt_of(state.changes)
    variance = np.maximum(np.diag(np.linalg.inv(matrix)), 0.0)
    units = np.array([change.slope(number) for change, number in state.changes])
    errors = np.sqrt(variance[: len(changes)]) * units
    return RobotFit(
        state.changes,
        state.deviations,
        state.cost - belief * deviation - doubt,
        deviation,
        doubt,
        _price(state.changes, errors, robot.values),
        errors,
        tuple(one.moved(u, robot.error) for one, u in zip(state.modes, state.deviations, strict=True)),
        float(np.sum(1 - belief * variance[len(changes) :])),
    )


def _price(changes: Changes, errors: Real, values: int) -> float:
    """Price of the numbers, as :class:`RobotFit`."""
    price = 0.0
    for (one, _), error in zip(changes, errors, strict=True):
        if isinstance(one, Change):
            price += float(np.log(values))
        else:
            price += max(2 * float(np.log(one.spread / max(float(error), 1e-300))), 0.0)
    return price
