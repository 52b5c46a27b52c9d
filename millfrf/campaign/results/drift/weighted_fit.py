"""Weighted least squares of one series, and the scatter between repeats that all series share."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import binomtest, chi2

Real = NDArray[np.float64]

CUT = 0.9
"""Quantile at which the misfit of one series is cut, so that a few series that drift or jump count little."""

FEW = 8
"""Series below which their sum is judged, not their number."""

LEAST_VARIANCE = 1e-16
"""Variance of a logarithm below which rounding counts."""


@dataclass(frozen=True)
class Problem:
    """A regression: logarithms on columns, the last of which is tested.

    Parameters
    ----------
    logs : (n,)
        Logarithms of a quantity.
    errors : (n,)
        Their stated standard errors.
    design : (n, n_columns)
        Columns of the regression, of full rank.
    """

    logs: Real
    errors: Real
    design: Real

    @property
    def freedom(self) -> int:
        """Number of values less number of columns."""
        return len(self.logs) - int(self.design.shape[1])


@dataclass(frozen=True)
class WeightedFit:
    """Result of a regression with weights.

    Parameters
    ----------
    coefficients : (n_columns,)
        Coefficients of the columns.
    covariance : (n_columns, n_columns)
        Their covariance, if the variances are right.
    residuals : (n,)
        Values less the regression.
    leverages : (n,)
        Share of each value in its own regression, 0 to 1.
    misfit
        Sum of squared residuals over their variances.
    """

    coefficients: Real
    covariance: Real
    residuals: Real
    leverages: Real
    misfit: float


def weighted_fit(problem: Problem, scatter: float) -> WeightedFit:
    """Fit one series with the variances ``errors^2 + scatter^2``.

    Parameters
    ----------
    problem
        Logarithms, errors and columns.
    scatter
        Standard deviation between repeats beyond the stated errors.
    """
    root = 1 / np.sqrt(variances(problem, scatter))
    scaled = problem.design * root[:, None]
    q, r = np.linalg.qr(scaled)
    coefficients = np.linalg.solve(r, q.T @ (problem.logs * root))
    residuals = problem.logs - problem.design @ coefficients
    inverse = np.linalg.inv(r)
    misfit = float(np.sum((residuals * root) ** 2))
    return WeightedFit(coefficients, inverse @ inverse.T, residuals, np.sum(q**2, axis=1), misfit)


def variances(problem: Problem, scatter: float) -> Real:
    """Variance of each value, stated error and scatter together, shape (n,)."""
    return np.asarray(problem.errors**2 + scatter**2 + LEAST_VARIANCE)


def shared_scatter(problems: Sequence[Problem]) -> float:
    """Standard deviation between repeats beyond the stated errors, shared by all series; 0 where errors explain all.

    Paule and Mandel (J. Res. NBS 87, 1982): the scatter with which the misfit equals the degrees of freedom. The
    misfit of each series is cut at a quantile of its distribution, and so is its expectation.

    Parameters
    ----------
    problems
        Regressions of all series; those without degrees of freedom say nothing.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> series = [Problem(rng.normal(0, 0.05, 5), np.full(5, 0.03), np.ones((5, 1))) for _ in range(200)]
    >>> round(shared_scatter(series), 2)
    0.04
    """
    useful = [one for one in problems if one.freedom > 0]
    if not useful:
        return 0.0
    freedom = np.array([one.freedom for one in useful])
    cut = chi2.ppf(CUT, freedom)
    expected = float(np.sum(freedom * chi2.cdf(cut, freedom + 2) + cut * (1 - CUT)))

    def excess(scatter: float) -> float:
        misfits = np.array([weighted_fit(one, scatter).misfit for one in useful])
        return float(np.sum(np.minimum(misfits, cut))) - expected

    if excess(0.0) <= 0:
        return 0.0
    high = max(float(np.std(one.logs)) for one in useful) * np.sqrt(max(len(one.logs) for one in useful)) + 1e-8
    return float(brentq(excess, 0.0, 4 * high, xtol=1e-9, rtol=1e-4))


@dataclass(frozen=True)
class ErrorBarCheck:
    """Stated standard errors against the scatter of repeats.

    Parameters
    ----------
    ratio
        Reduced chi-square of the typical (median) series with the stated errors alone; NaN: nothing to check with.
    freedom
        Degrees of freedom of all series together.
    p_value
        Probability of a ratio as far from one where the errors are right.
    """

    ratio: float
    freedom: int
    p_value: float


def check_error_bars(problems: Sequence[Problem]) -> ErrorBarCheck:
    """Compare the misfit of each series with what its stated errors alone lead one to expect.

    The ratio is that of the median series, so that a few that jump do not count; its probability is that of the number
    of series above their expected median (sign test), or of their sum where there are fewer than eight.

    Parameters
    ----------
    problems
        Regressions of all series; those of which an error is not known say nothing.
    """
    useful = [one for one in problems if one.freedom > 0 and (one.errors > 0).all()]
    if not useful:
        return ErrorBarCheck(float("nan"), 0, 1.0)
    freedom = np.array([one.freedom for one in useful])
    misfits = np.array([weighted_fit(one, 0.0).misfit for one in useful])
    over = misfits / chi2.ppf(0.5, freedom)
    if len(useful) < FEW:
        tail = chi2.sf(misfits.sum(), freedom.sum())
        return ErrorBarCheck(float(misfits.sum() / freedom.sum()), int(freedom.sum()), 2 * min(tail, 1 - tail))
    p_value = binomtest(int(np.sum(over > 1)), len(useful)).pvalue
    return ErrorBarCheck(float(np.median(over)), int(freedom.sum()), float(p_value))
