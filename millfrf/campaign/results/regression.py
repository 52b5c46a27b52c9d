"""Labels as regressors, and weighted least squares of one series."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from .sets import POSE, POSTURE, MeasuredSet

TIME = "time"
"""Name of the time of recording as a label, in days since the first set."""

DAY = 86400.0

_DIGITS = re.compile(r"-?\d+(\.\d+)?", re.ASCII)

MOST_GROUPS = 6
"""Values of a text that still count as groups; a text with more is a remark."""


@dataclass(frozen=True)
class Labels:
    """Labels of all sets as columns.

    Parameters
    ----------
    numbers : (n_sets,)
        Values of each label that holds numbers and varies inside a pose, by its name; NaN where a set lacks it.
    texts
        Values of each label that holds text and varies inside a pose, by its name.
    notes
        Sentences on labels that were left out or taken for another.
    """

    numbers: Mapping[str, Real]
    texts: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...] = ()


def labels_of(sets: Sequence[MeasuredSet]) -> Labels:
    """Sort the labels of a campaign into numbers and groups.

    A label counts as a number where each of its values is one or a text of digits: session ``07`` comes after ``06``,
    though it stays text in names of files and sets. A note says so. Other texts that Python could read as numbers
    (``nan``, ``1e5``, ``1_0``) are texts.

    Parameters
    ----------
    sets
        Sets of the campaign.
    """
    poses = np.array([one.pose for one in sets])
    numbers: dict[str, Real] = {}
    texts: dict[str, tuple[str, ...]] = {}
    notes: list[str] = []
    names = dict.fromkeys(name for one in sets for name in one.labels if name not in (POSE, POSTURE))
    for name in names:
        values = [one.labels.get(name) for one in sets]
        column = _as_numbers(values)
        if column is not None:
            numbers[name] = column
            if any(isinstance(value, str) for value in values):
                notes.append(f"label {name} is text of digits, such as {_first_text(values)}: it is taken for a number")
        elif len(set(values)) <= MOST_GROUPS:
            texts[name] = tuple("" if value is None else str(value) for value in values)
        else:
            notes.append(f"label {name} is a text of {len(set(values))} values: it is not looked at")
    times = np.array([np.nan if one.recorded_at is None else one.recorded_at for one in sets])
    if np.isfinite(times).any():
        numbers[TIME] = (times - np.nanmin(times)) / DAY
    numbers = {name: column for name, column in numbers.items() if _varies(column, poses)}
    same = _in_order_of_time(numbers, poses)
    if same:
        numbers.pop(TIME)
        notes.append(f"{same} rises with the time of recording in every pose: a trend over {same} is one over time")
    texts = {name: column for name, column in texts.items() if _varies(_codes(column), poses)}
    return Labels(numbers, texts, tuple(notes))


def dummies(texts: Mapping[str, tuple[str, ...]], rows: Sequence[int]) -> Real:
    """Columns 0 and 1 for the groups of chosen rows, one less than there are groups in each label.

    Parameters
    ----------
    texts
        Labels of text, see :class:`Labels`.
    rows
        Numbers of the chosen sets.
    """
    columns = [
        [float(column[row] == value) for row in rows]
        for column in texts.values()
        for value in sorted({column[row] for row in rows})[1:]
    ]
    return np.array(columns, dtype=float).reshape(len(columns), len(rows)).T


def _as_numbers(values: Sequence[str | float | None]) -> Real | None:
    """A column of numbers; None where a value spells none."""
    if any(isinstance(value, str) and _DIGITS.fullmatch(value) is None for value in values):
        return None
    column = np.array([np.nan if value is None else float(value) for value in values])
    return column if np.isfinite(column).any() else None


def _first_text(values: Sequence[str | float | None]) -> str:
    return next(value for value in values if isinstance(value, str))


def _codes(column: tuple[str, ...]) -> Real:
    order = sorted(set(column))
    return np.array([float(order.index(value)) for value in column])


def _varies(column: Real, poses: NDArray[np.str_]) -> bool:
    """Whether it has two values in some pose."""
    return any(len(np.unique(column[(poses == pose) & np.isfinite(column)])) > 1 for pose in np.unique(poses))


def _in_order_of_time(numbers: Mapping[str, Real], poses: NDArray[np.str_]) -> str:
    """Name of the label that counts time, such as a session: whole numbers that never fall while time rises."""
    if TIME not in numbers:
        return ""
    for name in sorted(numbers):
        column = numbers[name]
        if (
            name != TIME
            and _counts(column)
            and all(_rises(column, numbers[TIME], poses == p) for p in np.unique(poses))
        ):
            return name
    return ""


def _counts(column: Real) -> bool:
    known = column[np.isfinite(column)]
    return bool(np.all(known == np.round(known)) and len(known) == len(column))


def _rises(column: Real, time: Real, chosen: NDArray[np.bool_]) -> bool:
    order = np.argsort(time[chosen], kind="stable")
    return bool(np.all(np.isfinite(time[chosen])) and np.all(np.diff(column[chosen][order]) >= 0))


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
    cut = scipy.stats.chi2.ppf(CUT, freedom)
    expected = float(np.sum(freedom * scipy.stats.chi2.cdf(cut, freedom + 2) + cut * (1 - CUT)))

    def excess(scatter: float) -> float:
        misfits = np.array([weighted_fit(one, scatter).misfit for one in useful])
        return float(np.sum(np.minimum(misfits, cut))) - expected

    if excess(0.0) <= 0:
        return 0.0
    high = max(float(np.std(one.logs)) for one in useful) * np.sqrt(max(len(one.logs) for one in useful)) + 1e-8
    return float(scipy.optimize.brentq(excess, 0.0, 4 * high, xtol=1e-9, rtol=1e-4))


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
    over = misfits / scipy.stats.chi2.ppf(0.5, freedom)
    if len(useful) < FEW:
        tail = scipy.stats.chi2.sf(misfits.sum(), freedom.sum())
        return ErrorBarCheck(float(misfits.sum() / freedom.sum()), int(freedom.sum()), 2 * min(tail, 1 - tail))
    p_value = scipy.stats.binomtest(int(np.sum(over > 1)), len(useful)).pvalue
    return ErrorBarCheck(float(np.median(over)), int(freedom.sum()), float(p_value))
