"""Damped Gauss-Newton steps, paired tests over blocks of time, and jackknife errors."""

from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
import scipy

from millfrf.core import Real

State = TypeVar("State")


class Problem(Protocol[State]):
    """A least-squares problem; a state contains the numbers and all results computed from them."""

    def cost(self, state: State) -> float:
        """Return the cost that is minimised; infinite where the prediction is not finite."""
        ...

    def normal_equations(self, state: State) -> tuple[Real, Real]:
        """Return the matrix ``J^T J`` and the downhill gradient ``J^T r``, both including the terms of the prior."""
        ...

    def step(self, state: State, matrix: Real, gradient: Real) -> Real:
        """Return the change of the coordinates that solves damped normal equations."""
        ...

    def moved(self, state: State, step: Real) -> State:
        """Return the state after a change of the coordinates, with the same nuisance parameters."""
        ...

    def settled(self, state: State) -> State:
        """Return the state with its nuisance parameters (the noise) fitted again."""
        ...


@dataclass(frozen=True)
class Limits:
    """Stopping criteria of a descent."""

    max_steps: int = 8  # largest number of steps
    # significant gain in cost; a step with an expected gain below a tenth of it ends the descent
    tolerance: float = 3.0
    max_idle: int = 2  # consecutive steps with a gain below the tolerance that end the descent
    max_lengths: int = 4  # largest number of trial lengths of a step, each a quarter of the one before
    # Levenberg's damping, relative to the diagonal, above which a failed step ends the descent
    max_damping: float = 1.0
    lengthen: bool = True  # whether steps that gain more than expected are lengthened
    # cost that the fit must reach to be useful: a step is idle if equal gains in all remaining steps would not reach it
    goal: float = np.inf

    def least_gain(self, cost: float, remaining: int) -> float:
        """Return the gain of a step below which it is idle.

        >>> Limits(goal=100.0).least_gain(500.0, 4), Limits().least_gain(500.0, 4)
        (100.0, 3.0)
        """
        return max(self.tolerance, (cost - self.goal) / max(remaining, 1))


@dataclass(frozen=True)
class Descended(Generic[State]):
    """Best state of a descent, and the last computed normal matrix, (n, n)."""

    state: State
    matrix: Real


def descend(problem: Problem[State], start: State, limits: Limits) -> Descended[State]:
    """Minimise a cost by Gauss-Newton steps with Levenberg's damping.

    Source: Nocedal & Wright, Numerical Optimization, 2nd ed., sections 10.2 and 10.3.
    """
    state = start
    matrix, gradient = problem.normal_equations(state)
    damping, idle = 0.0, 0
    for number in range(limits.max_steps):
        step = problem.step(state, matrix + damping * np.diag(np.diag(matrix)), gradient)
        expected_gain = float(step @ gradient)
        # a step is not finite if a law is so stiff that its derivatives overflow
        if not expected_gain >= 0.1 * limits.tolerance or not np.isfinite(step).all():
            break
        cost_before = problem.cost(state)
        trial = _line_search(problem, state, step, expected_gain, limits)
        equations = None
        if problem.cost(trial) < cost_before:
            trial = problem.settled(trial)
            equations = _finite_equations(problem, trial)
        if equations is None:
            if damping > limits.max_damping:
                break
            damping = max(10 * damping, 0.1)
            continue
        damping /= 10
        state, (matrix, gradient) = trial, equations
        # a single idle step may be due to nuisance parameters that have not converged: max_idle such steps are needed
        cost = problem.cost(state)
        idle = idle + 1 if cost_before - cost < limits.least_gain(cost, limits.max_steps - number - 1) else 0
        if idle == limits.max_idle:
            break
    return Descended(state, matrix)


def _finite_equations(problem: Problem[State], state: State) -> tuple[Real, Real] | None:
    """Return the normal equations of a state; None if derivatives diverge, so that the state cannot be accepted."""
    try:
        return problem.normal_equations(state)
    except np.linalg.LinAlgError:
        return None


def _line_search(problem: Problem[State], state: State, step: Real, expected_gain: float, limits: Limits) -> State:
    cost = problem.cost(state)
    for _ in range(limits.max_lengths):
        trial = problem.moved(state, step)
        if problem.cost(trial) < cost:
            break
        step = 0.25 * step
    # if the linear model underestimates the gain, the step is lengthened while the cost falls
    while limits.lengthen and cost - problem.cost(trial) > 1.5 * expected_gain:
        step = 3.0 * step
        farther = problem.moved(state, step)
        if not problem.cost(farther) < problem.cost(trial):
            break
        trial = farther
    return trial


def plain_step(matrix: Real, gradient: Real) -> Real:
    """Solve the normal equations; return the shortest solution (n,) if they are singular."""
    try:
        return np.asarray(np.linalg.solve(matrix, gradient), dtype=float)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.lstsq(matrix, gradient, rcond=1e-12)[0], dtype=float)


def bounded_step(position: Real, matrix: Real, gradient: Real, low: Real, high: Real) -> Real:
    """Solve the normal equations within bounds (active set; Bertsekas, SIAM J. Control Optim. 20, 1982).

    Coordinates at a bound that the gradient pushes outwards are fixed. Coordinates that would cross a bound are set to
    the bound, and the equations are solved again for the others. ``matrix`` (n, n) is the damped normal matrix.
    ``gradient`` (n,) points downhill: without bounds, the step is ``matrix^-1 gradient``. ``position`` (n,) lies within
    the bounds.
    """
    free = ~(((position <= low) & (gradient < 0)) | ((position >= high) & (gradient > 0)))
    trial = position.copy()
    for _ in range(len(position)):
        if not free.any():
            break
        free_matrix = matrix[np.ix_(free, free)]
        push = gradient[free] - matrix[np.ix_(free, ~free)] @ (trial - position)[~free]
        # the small ridge keeps the equations solvable if they hardly depend on a free coordinate
        ridge = 1e-12 * np.trace(free_matrix) * np.eye(len(free_matrix))
        trial[free] = position[free] + plain_step(free_matrix + ridge, push)
        outside = (trial < low) | (trial > high)
        trial = np.clip(trial, low, high)
        if not outside.any():
            break
        free &= ~outside
    return np.asarray(trial - position)


def signed_ranks(before: Real, after: Real) -> float:
    """Return the p-value that ``after`` is not below ``before`` (Wilcoxon, Biometrics Bulletin 1, 1945).

    Both are residual powers in the same blocks of time under two hypotheses, (n_blocks,).
    """
    fall = before - after
    return float(scipy.stats.wilcoxon(fall, alternative="greater").pvalue) if fall.any() else 1.0


def students_test(before: Real, after: Real) -> float:
    """Return the p-value of Student's test that ``after`` is not below ``before`` in the mean over the blocks.

    The test is for so few blocks that signed ranks cannot be significant.
    """
    fall = before - after
    return float(scipy.stats.ttest_1samp(fall, 0.0, alternative="greater").pvalue) if np.ptp(fall) > 0 else 1.0


def ratio_interval(before: Real, after: Real) -> tuple[float, float]:
    """Return the 95 % interval of ``sqrt(sum after / sum before)``, bootstrapped over blocks.

    Efron & Tibshirani, An Introduction to the Bootstrap, 1993, chapter 13.
    """
    # a fixed seed, so that a diagnosis can be repeated
    draw = np.random.default_rng(0).integers(0, len(before), (1000, len(before)))
    ratio = np.sqrt(after[draw].sum(axis=1) / before[draw].sum(axis=1))
    low, high = np.quantile(ratio, [0.025, 0.975])
    return float(low), float(high)


def jackknife_variance(numbers: Real) -> Real:
    """Return the variance (n_numbers,) of numbers that were fitted with each part left out, (n_parts, n_numbers).

    ``(n - 1) / n sum (theta_i - mean)^2``; Efron & Tibshirani, An Introduction to the Bootstrap, 1993, chapter 11.
    """
    count = len(numbers)
    return np.asarray((count - 1) / count * np.sum((numbers - numbers.mean(axis=0)) ** 2, axis=0))


def shift_weight(gain: float) -> float:
    """Return the weight ``1 - exp(-gain / 2)`` of the shift of a number if a further cause with this gain is free."""
    return float(1 - np.exp(-max(gain, 0.0) / 2))
