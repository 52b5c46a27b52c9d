"""Damped Gauss-Newton steps on any hypothesis: shortened until they gain, lengthened while they gain more."""

from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from millfrf.core import Real

State = TypeVar("State")

SHORTER = 0.25
"""Factor on a step that does not gain."""

MORE_THAN_EXPECTED, LONGER = 1.5, 3.0
"""Gain of a step over the gain expected of it from which a longer one is tried, and how much longer."""


class Problem(Protocol[State]):
    """What a hypothesis gives to the descent; a state is its numbers with all that was computed for them."""

    def cost(self, state: State) -> float:
        """What is minimised; infinite where the hypothesis predicts nothing finite."""
        ...

    def normal_equations(self, state: State) -> tuple[Real, Real]:
        """Matrix ``J^T J`` with the belief's, and gradient ``J^T r`` with the belief's, in the fit's coordinates."""
        ...

    def step(self, state: State, matrix: Real, gradient: Real) -> Real:
        """Change of the coordinates from normal equations that are damped already."""
        ...

    def moved(self, state: State, step: Real) -> State:
        """The state after a change of the coordinates, nuisance numbers held."""
        ...

    def settled(self, state: State) -> State:
        """The state with its nuisance numbers (noise) fitted anew, once a step was taken."""
        ...


@dataclass(frozen=True)
class Limits:
    """When a descent ends.

    Parameters
    ----------
    most
        Steps at most.
    tolerance
        Gain in cost that counts; a step from which less than a tenth of it is expected is not taken.
    idle
        Steps in a row below the tolerance that end the descent.
    tries
        Lengths that are tried of a step, each a quarter of the one before.
    most_damping
        Levenberg's damping, as a share of the diagonal, above which a failed step ends the descent.
    lengthens
        Whether steps that gain more than expected are lengthened.
    goal
        Cost above which the fit is worth nothing: a step that many like it would not bring there counts as idle.
    """

    most: int = 8
    tolerance: float = 3.0
    idle: int = 2
    tries: int = 4
    most_damping: float = 1.0
    lengthens: bool = True
    goal: float = np.inf

    def least_gain(self, cost: float, left: int) -> float:
        """Gain of a step that counts, where ``left`` more may follow.

        Examples
        --------
        >>> Limits(goal=100.0).least_gain(500.0, 4), Limits().least_gain(500.0, 4)
        (100.0, 3.0)
        """
        return max(self.tolerance, (cost - self.goal) / max(left, 1))


@dataclass(frozen=True)
class Descended(Generic[State]):
    """Where a descent ends.

    Parameters
    ----------
    state
        The numbers at their best.
    matrix : (n, n)
        Normal matrix at the last point at which derivatives were taken.
    """

    state: State
    matrix: Real


def descend(problem: Problem[State], start: State, limits: Limits) -> Descended[State]:
    """Minimise a cost by Gauss-Newton steps with Levenberg's damping (Nocedal & Wright, 2nd ed., sections 10.2-10.3).

    Parameters
    ----------
    problem
        Cost, derivatives and moves of the hypothesis.
    start
        Where to begin.
    limits
        When to end.
    """
    state = start
    matrix, gradient = problem.normal_equations(state)
    damping, idle = 0.0, 0
    for number in range(limits.most):
        step = problem.step(state, matrix + damping * np.diag(np.diag(matrix)), gradient)
        expected = float(step @ gradient)
        # no step is taken either where a law is stiffer than its derivatives can follow
        if not expected >= 0.1 * limits.tolerance or not np.isfinite(step).all():
            break
        before = problem.cost(state)
        farther = _downhill(problem, state, step, expected, limits)
        equations = None
        if problem.cost(farther) < before:
            farther = problem.settled(farther)
            equations = _equations(problem, farther)
        if equations is None:
            if damping > limits.most_damping:
                break
            damping = max(10 * damping, 0.1)
            continue
        damping /= 10
        state, (matrix, gradient) = farther, equations
        # nuisance numbers may still be settling when a step gains nothing
        cost = problem.cost(state)
        idle = idle + 1 if before - cost < limits.least_gain(cost, limits.most - number - 1) else 0
        if idle == limits.idle:
            break
    return Descended(state, matrix)


def _equations(problem: Problem[State], state: State) -> tuple[Real, Real] | None:
    """Normal equations of a state; None where derivatives run away, so that no step leads there."""
    try:
        return problem.normal_equations(state)
    except np.linalg.LinAlgError:
        return None


def _downhill(problem: Problem[State], here: State, step: Real, expected: float, limits: Limits) -> State:
    """Where a step leads, shortened until it gains, lengthened while that gains more than expected."""
    cost = problem.cost(here)
    for _ in range(limits.tries):
        there = problem.moved(here, step)
        if problem.cost(there) < cost:
            break
        step = SHORTER * step
    while limits.lengthens and cost - problem.cost(there) > MORE_THAN_EXPECTED * expected:
        # a valley that is longer than its derivatives say
        step = LONGER * step
        farther = problem.moved(here, step)
        if not problem.cost(farther) < problem.cost(there):
            break
        there = farther
    return there


def plain_step(matrix: Real, gradient: Real) -> Real:
    """Solution of the normal equations; the shortest one where they are singular.

    Parameters
    ----------
    matrix : (n, n)
        Damped normal matrix.
    gradient : (n,)
        Right-hand side of the normal equations.
    """
    try:
        return np.asarray(np.linalg.solve(matrix, gradient), dtype=float)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0], dtype=float)


def bounded_step(here: Real, matrix: Real, gradient: Real, low: Real, high: Real) -> Real:
    """Solution of the normal equations within bounds (active set; Bertsekas, SIAM J. Control Optim. 20, 1982).

    Numbers at a bound that the gradient pushes outwards are held; those that would leave the bounds are set on them,
    and the others are solved again.

    Parameters
    ----------
    here : (n,)
        Coordinates now, within the bounds.
    matrix : (n, n)
        Damped normal matrix.
    gradient : (n,)
        Downhill right-hand side: the free solution is ``matrix^-1 gradient``.
    low, high : (n,)
        Bounds of the coordinates.

    Examples
    --------
    >>> one = np.ones(1)
    >>> bounded_step(0 * one, np.eye(1), 2 * one, -one, one).tolist()
    [1.0]
    """
    free = ~(((here <= low) & (gradient < 0)) | ((here >= high) & (gradient > 0)))
    tried = here.copy()
    for _ in range(len(here)):
        if not free.any():
            break
        part = matrix[np.ix_(free, free)]
        push = gradient[free] - matrix[np.ix_(free, ~free)] @ (tried - here)[~free]
        tried[free] = here[free] + plain_step(part + 1e-12 * np.trace(part) * np.eye(len(part)), push)
        outside = (tried < low) | (tried > high)
        tried = np.clip(tried, low, high)
        if not outside.any():
            break
        free &= ~outside
    return np.asarray(tried - here)
