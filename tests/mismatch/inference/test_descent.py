"""The descent on problems whose minimum is known, and its bounded step against another solver."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from millfrf.mismatch.inference.numerics import Limits, bounded_step, descend, plain_step

Real = NDArray[np.float64]

EXACT = Limits(max_steps=60, tolerance=1e-12, max_idle=1)


@dataclass(frozen=True)
class LeastSquares:
    """``sum r(x)^2`` within bounds; the state is x itself."""

    residual: Callable[[Real], Real]
    slopes: Callable[[Real], Real]
    low: float = -np.inf
    high: float = np.inf

    def cost(self, state: Real) -> float:
        return float(np.sum(self.residual(state) ** 2))

    def normal_equations(self, state: Real) -> tuple[Real, Real]:
        jacobian = self.slopes(state)
        return jacobian.T @ jacobian, -jacobian.T @ self.residual(state)

    def step(self, state: Real, matrix: Real, gradient: Real) -> Real:
        ones = np.ones(len(state))
        return bounded_step(state, matrix, gradient, self.low * ones, self.high * ones)

    def moved(self, state: Real, step: Real) -> Real:
        return np.clip(state + step, self.low, self.high)

    def settled(self, state: Real) -> Real:
        return state


def _rosenbrock() -> LeastSquares:
    """``(10 (y - x^2), 1 - x)``: a bent valley with its minimum, zero, at (1, 1)."""
    return LeastSquares(
        lambda x: np.array([10 * (x[1] - x[0] ** 2), 1 - x[0]]),
        lambda x: np.array([[-20 * x[0], 10.0], [-1.0, 0.0]]),
    )


def test_a_linear_problem_is_solved_in_one_step() -> None:
    rng = np.random.default_rng(1)
    matrix, aim = rng.standard_normal((20, 4)), rng.standard_normal(20)
    problem = LeastSquares(lambda x: matrix @ x - aim, lambda x: matrix)
    end = descend(problem, np.zeros(4), Limits(max_steps=1, tolerance=1e-9))
    np.testing.assert_allclose(end.state, np.linalg.lstsq(matrix, aim, rcond=None)[0], atol=1e-9)
    np.testing.assert_allclose(end.matrix, matrix.T @ matrix)


def test_a_bent_valley_is_followed_to_its_end() -> None:
    end = descend(_rosenbrock(), np.array([-1.2, 1.0]), EXACT)
    np.testing.assert_allclose(end.state, [1.0, 1.0], atol=1e-6)


def test_without_residual_at_the_minimum_steps_converge_quadratically() -> None:
    """Gauss-Newton is Newton's method there: ``e_(k+1) < C e_k^2`` (Nocedal & Wright, section 10.3)."""
    problem = LeastSquares(
        lambda x: np.array([np.exp(x[0]) - 2.0, x[0] * x[1] - 1.0, np.sin(x[1]) - np.sin(1 / np.log(2.0))]),
        lambda x: np.array([[np.exp(x[0]), 0.0], [x[1], x[0]], [0.0, np.cos(x[1])]]),
    )
    truth = np.array([np.log(2.0), 1 / np.log(2.0)])
    here, errors = truth + np.array([0.2, -0.15]), []
    for _ in range(5):
        errors.append(float(np.linalg.norm(here - truth)))
        here = descend(problem, here, Limits(max_steps=1, tolerance=1e-30, lengthen=False)).state
    orders = [np.log(errors[k + 1] / errors[k]) / np.log(errors[k] / errors[k - 1]) for k in (1, 2)]
    assert min(orders) > 1.8, errors


def test_a_fall_that_is_not_expected_is_not_sought() -> None:
    start = np.array([1.001, 1.002])
    end = descend(_rosenbrock(), start, Limits(tolerance=1.0))
    np.testing.assert_array_equal(end.state, start)


def test_a_step_too_long_is_shortened_until_it_gains() -> None:
    """``arctan`` from 3: full steps lead to -9.5, then to 124, and so on."""
    problem = LeastSquares(lambda x: np.arctan(x), lambda x: np.diag(1 / (1 + x**2)))
    full = 3.0 - np.arctan(3.0) * (1 + 3.0**2)
    assert full == pytest.approx(-9.49, abs=0.01)
    end = descend(problem, np.array([3.0]), EXACT)
    assert abs(float(end.state[0])) < 1e-5


def test_steps_are_lengthened_only_where_that_is_asked() -> None:
    """The second residual falls only at second order: a step of 1 gains 2.9 where 1 is expected, one of 3 gains 6."""
    problem = LeastSquares(
        lambda x: np.array([1 - x[0], 3 * (1 - (x[0] / 3) ** 2)]), lambda x: np.array([[-1.0], [-2 * x[0] / 3]])
    )
    for lengthens, end in ((False, 1.0), (True, 3.0)):
        limits = Limits(max_steps=1, tolerance=1e-6, lengthen=lengthens)
        assert float(descend(problem, np.zeros(1), limits).state[0]) == pytest.approx(end, rel=1e-9)


def test_a_problem_without_finite_steps_ends_where_it_began() -> None:
    problem = LeastSquares(lambda x: x - 1, lambda x: np.full((1, 1), np.nan))
    assert descend(problem, np.zeros(1), EXACT).state.tolist() == [0.0]


def test_no_step_leads_to_where_derivatives_run_away() -> None:
    """The minimum at 2.1 lies beyond 1.5, where there is no derivative: the descent ends before, where there is one."""

    def slopes(x: Real) -> Real:
        if x[0] > 1.5:
            raise np.linalg.LinAlgError("the motion runs away")
        return np.ones((1, 1))

    problem = LeastSquares(lambda x: x - 2.1, slopes)
    end = descend(problem, np.zeros(1), replace(EXACT, lengthen=False))
    assert 1.0 < float(end.state[0]) <= 1.5
    problem.normal_equations(end.state)


def test_bounded_least_squares_agree_with_another_solver() -> None:
    rng = np.random.default_rng(7)
    for _ in range(20):
        matrix, aim = rng.standard_normal((30, 5)), rng.standard_normal(30)
        problem = LeastSquares(lambda x, m=matrix, b=aim: m @ x - b, lambda x, m=matrix: m, -0.1, 0.15)
        end = descend(problem, np.zeros(5), replace(EXACT, max_idle=3))
        expected = lsq_linear(matrix, aim, (-0.1 * np.ones(5), 0.15 * np.ones(5)), tol=1e-12)
        assert problem.cost(end.state) == pytest.approx(2 * expected.cost, rel=1e-6)


def test_a_number_at_its_bound_that_is_pushed_outwards_is_held() -> None:
    matrix = np.array([[2.0, 1.0], [1.0, 2.0]])
    step = bounded_step(np.zeros(2), matrix, np.array([-1.0, 1.0]), np.zeros(2), np.ones(2))
    np.testing.assert_allclose(step, [0.0, 0.5], atol=1e-9)


def test_bounded_steps_stay_within_bounds_and_are_free_inside() -> None:
    rng = np.random.default_rng(3)
    for _ in range(50):
        root = rng.standard_normal((6, 4))
        matrix, gradient = root.T @ root, rng.standard_normal(4)
        low, high = -rng.uniform(0, 1, 4), rng.uniform(0, 1, 4)
        step = bounded_step(np.zeros(4), matrix, gradient, low, high)
        assert (step >= low).all()
        assert (step <= high).all()
        free = bounded_step(np.zeros(4), matrix, gradient, low - 1e6, high + 1e6)
        np.testing.assert_allclose(free, np.linalg.solve(matrix, gradient), rtol=1e-5, atol=1e-7)


def test_a_singular_problem_takes_the_shortest_step() -> None:
    matrix = np.array([[1.0, 1.0], [1.0, 1.0]])
    np.testing.assert_allclose(plain_step(matrix, np.array([2.0, 2.0])), [1.0, 1.0])


def test_a_descent_that_cannot_reach_its_goal_ends_early() -> None:
    """``sum exp(x)^2`` falls by a share of itself at each step, towards zero and never below."""
    problem = LeastSquares(lambda x: np.exp(x), lambda x: np.diag(np.exp(x)))
    limits = Limits(max_steps=6, tolerance=1e-12, max_idle=1, lengthen=False)
    start = np.array([1.0])
    to_its_end = descend(problem, start, limits).state
    assert to_its_end[0] == pytest.approx(-5.0)  # Gauss-Newton's step is one
    assert descend(problem, start, replace(limits, goal=-1000.0)).state[0] == pytest.approx(0.0)
    assert descend(problem, start, replace(limits, goal=0.1)).state[0] == to_its_end[0]
