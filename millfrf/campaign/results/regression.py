"""Labels as regressors, weighted least squares of one series, and moderated variances of many."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from .sets import POSE, POSTURE, MeasuredSet
from .settings import SETTINGS

TIME = "time"  # label of the time of recording, days since the first set
DAY = 86400.0  # s
_DIGITS = re.compile(r"-?\d+(\.\d+)?", re.ASCII)


@dataclass(frozen=True)
class Labels:
    """Labels of all sets that vary inside a pose, as columns."""

    numbers: Mapping[str, Real]  # (n_sets,); numeric labels; NaN: the set lacks the label
    texts: Mapping[str, tuple[str, ...]]  # text labels
    notes: tuple[str, ...] = ()  # sentences on labels that are not used or are converted


def labels_of(sets: Sequence[MeasuredSet]) -> Labels:
    """Sort the labels of a campaign into numbers and groups.

    A label is numeric if each value is a number or a text of digits: session ``07`` follows ``06``. Other texts that
    Python reads as numbers (``nan``, ``1e5``, ``1_0``) are texts.
    """
    poses = np.array([measured.pose for measured in sets])
    numbers: dict[str, Real] = {}
    texts: dict[str, tuple[str, ...]] = {}
    notes: list[str] = []
    names = dict.fromkeys(name for measured in sets for name in measured.labels if name not in (POSE, POSTURE))
    for name in names:
        values = [measured.labels.get(name) for measured in sets]
        column = _as_numbers(values)
        if column is not None:
            numbers[name] = column
            if any(isinstance(value, str) for value in values):
                notes.append(f"label {name} is text of digits, such as {_first_text(values)}: it is used as a number")
        elif len(set(values)) <= SETTINGS.most_groups:
            texts[name] = tuple("" if value is None else str(value) for value in values)
        else:
            notes.append(f"label {name} is a text of {len(set(values))} values: it is not used")
    times = np.array([np.nan if measured.recorded_at is None else measured.recorded_at for measured in sets])
    if np.isfinite(times).any():
        numbers[TIME] = (times - np.nanmin(times)) / DAY
    numbers = {name: column for name, column in numbers.items() if _varies(column, poses)}
    counter = _in_order_of_time(numbers, poses)
    if counter:
        numbers.pop(TIME)
        notes.append(
            f"{counter} rises with the time of recording in every pose: a trend over {counter} is one over time"
        )
    texts = {name: column for name, column in texts.items() if _varies(_codes(column), poses)}
    return Labels(numbers, texts, tuple(notes))


def dummies(texts: Mapping[str, tuple[str, ...]], rows: Sequence[int]) -> Real:
    """Return a dummy column (0 or 1) for each group except the first group of each label."""
    columns = [
        [float(column[row] == value) for row in rows]
        for column in texts.values()
        for value in sorted({column[row] for row in rows})[1:]
    ]
    return np.array(columns, dtype=float).reshape(len(columns), len(rows)).T


def _as_numbers(values: Sequence[str | float | None]) -> Real | None:
    """Convert values to a column of numbers; None if a value is no number."""
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
    """Return whether the column has two values in at least one pose."""
    return any(len(np.unique(column[(poses == pose) & np.isfinite(column)])) > 1 for pose in np.unique(poses))


def _in_order_of_time(numbers: Mapping[str, Real], poses: NDArray[np.str_]) -> str:
    """Return the whole-number label that increases with time in every pose, such as a session; empty if none does."""
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


@dataclass(frozen=True)
class Problem:
    """A regression of logarithms; the coefficient of the last column is tested."""

    logs: Real  # (n,); dependent variable
    errors: Real  # (n,); stated standard errors
    design: Real  # (n, n_columns); of full rank

    @property
    def freedom(self) -> int:
        """Degrees of freedom."""
        return len(self.logs) - int(self.design.shape[1])


@dataclass(frozen=True)
class WeightedFit:
    """Result of a weighted regression."""

    coefficients: Real  # (n_columns,)
    covariance: Real  # (n_columns, n_columns); if the variances are right
    residuals: Real  # (n,)
    leverages: Real  # (n,); diagonal of the hat matrix
    misfit: float  # chi-square: sum of squared residuals over their variances


def weighted_fit(problem: Problem, scatter: float) -> WeightedFit:
    """Fit one series with the variances ``errors^2 + scatter^2``."""
    root = 1 / np.sqrt(variances(problem, scatter))
    scaled = problem.design * root[:, None]
    q, r = np.linalg.qr(scaled)
    coefficients = np.linalg.solve(r, q.T @ (problem.logs * root))
    residuals = problem.logs - problem.design @ coefficients
    inverse = np.linalg.inv(r)
    misfit = float(np.sum((residuals * root) ** 2))
    return WeightedFit(coefficients, inverse @ inverse.T, residuals, np.sum(q**2, axis=1), misfit)


def variances(problem: Problem, scatter: float) -> Real:
    """Return the variance of each value, from its stated error and the scatter."""
    return np.asarray(problem.errors**2 + scatter**2 + SETTINGS.least_variance)


def shared_scatter(problems: Sequence[Problem]) -> float:
    """Estimate the common standard deviation between repeats beyond the stated errors.

    The scatter is that for which the misfit equals the degrees of freedom, or 0 (Paule and Mandel, J. Res. NBS 87,
    1982). The misfit of each series, and its expectation, are truncated at a quantile of the chi-square distribution.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> series = [Problem(rng.normal(0, 0.05, 5), np.full(5, 0.03), np.ones((5, 1))) for _ in range(200)]
    >>> round(shared_scatter(series), 2)
    0.04
    """
    usable = [problem for problem in problems if problem.freedom > 0]
    if not usable:
        return 0.0
    freedom = np.array([problem.freedom for problem in usable])
    cut = scipy.stats.chi2.ppf(SETTINGS.misfit_quantile, freedom)
    expected = float(np.sum(freedom * scipy.stats.chi2.cdf(cut, freedom + 2) + cut * (1 - SETTINGS.misfit_quantile)))

    def excess(scatter: float) -> float:
        misfits = np.array([weighted_fit(problem, scatter).misfit for problem in usable])
        return float(np.sum(np.minimum(misfits, cut))) - expected

    if excess(0.0) <= 0:
        return 0.0
    high = (
        max(float(np.std(problem.logs)) for problem in usable) * np.sqrt(max(len(problem.logs) for problem in usable))
        + 1e-8
    )
    return float(scipy.optimize.brentq(excess, 0.0, 4 * high, xtol=1e-9, rtol=1e-4))


@dataclass(frozen=True)
class ErrorBarCheck:
    """Comparison of stated standard errors with the scatter of repeats."""

    ratio: float  # reduced chi-square of the median series; NaN: no series
    freedom: int  # of all series together
    p_value: float  # probability of a ratio at least as far from 1 if the stated errors are right


def check_error_bars(problems: Sequence[Problem]) -> ErrorBarCheck:
    """Test whether the misfit of the series agrees with their stated errors.

    The ratio is taken from the median series, because a few series with jumps do not change the median. A sign test is
    applied to the number of series above their expected median; with fewer than eight series, a chi-square test is
    applied to the sum of their misfits.
    """
    usable = [problem for problem in problems if problem.freedom > 0 and (problem.errors > 0).all()]
    if not usable:
        return ErrorBarCheck(float("nan"), 0, 1.0)
    freedom = np.array([problem.freedom for problem in usable])
    misfits = np.array([weighted_fit(problem, 0.0).misfit for problem in usable])
    ratios = misfits / scipy.stats.chi2.ppf(0.5, freedom)
    if len(usable) < SETTINGS.sign_test_series:
        tail = scipy.stats.chi2.sf(misfits.sum(), freedom.sum())
        return ErrorBarCheck(float(misfits.sum() / freedom.sum()), int(freedom.sum()), 2 * min(tail, 1 - tail))
    p_value = scipy.stats.binomtest(int(np.sum(ratios > 1)), len(usable)).pvalue
    return ErrorBarCheck(float(np.median(ratios)), int(freedom.sum()), float(p_value))


# grid of prior degrees of freedom: few if the variances of series differ, many if they are equal
FREEDOM = np.logspace(0.2, 3, 18)

# their prior: median, and standard deviation in decades. A few series do not determine them.
USUAL_FREEDOM, DECADES = 6.0, 0.4

# grid of common variance factors relative to the mean of all series; flat prior of the logarithm
FACTORS = np.exp(np.linspace(-3.5, 3.5, 57))


@dataclass(frozen=True)
class Moderated:
    """Variance factor of one series: a mixture of scaled inverse chi-squares."""

    weights: Real  # (n,); probabilities of the components
    factors: Real  # (n,); variance factors of the components
    freedoms: Real  # (n,); degrees of freedom of the components

    @property
    def factor(self) -> float:
        """Mean variance factor."""
        return float(self.weights @ self.factors)

    @property
    def freedom(self) -> float:
        """Effective degrees of freedom: harmonic mean over the components."""
        return float(1 / (self.weights @ (1 / self.freedoms)))

    def p_value(self, ratio: float) -> float:
        """Return the two-sided p-value of a value; ``ratio`` is value over standard error for the variance factor 1."""
        parts = 2 * scipy.stats.t.sf(abs(ratio) / np.sqrt(self.factors), self.freedoms)
        return min(1.0, float(self.weights @ parts))


@dataclass(frozen=True)
class CommonVariance:
    """Hierarchical model of the variances of series in groups.

    The ratio of misfit to degrees of freedom is distributed as ``factor F(freedom, prior freedom)`` (Smyth, Stat. Appl.
    Genet. Mol. Biol. 3, 2004), with a factor for each group and common prior degrees of freedom. Factors and prior
    degrees of freedom are integrated over a grid, because few series do not determine them.
    """

    misfits: Real  # (n_series,); chi-squares
    freedom: Real  # (n_series,); degrees of freedom; 0: no information
    groups: Sequence[int]  # (n_series,); number of the group

    @cached_property
    def _centres(self) -> dict[int, float]:
        """Mean ratio of misfit to freedom in each group."""
        centres = {}
        for group in set(self.groups):
            chosen = [k for k, g in enumerate(self.groups) if g == group and self.freedom[k] > 0]
            total = float(np.sum(self.freedom[chosen]))
            centres[group] = max(float(np.sum(self.misfits[chosen])) / total, 1e-6) if total else 1.0
        return centres

    @cached_property
    def _single(self) -> Real:
        """Log-likelihood over series (first axis), factors and prior degrees of freedom of the grid."""
        return np.array([self._likelihood(*row) for row in zip(self.misfits, self.freedom, self.groups, strict=True)])

    @cached_property
    def _sums(self) -> dict[int, Real]:
        """Log-likelihood of each group."""
        sums = {group: np.zeros((len(FACTORS), len(FREEDOM))) for group in set(self.groups)}
        for group, likelihood in zip(self.groups, self._single, strict=True):
            sums[group] = sums[group] + likelihood
        return sums

    @cached_property
    def _other_groups(self) -> dict[int, Real]:
        """Log prior of the degrees of freedom plus the log evidence of the other groups."""
        prior = -0.5 * (np.log10(FREEDOM / USUAL_FREEDOM) / DECADES) ** 2
        evidence = {
            group: np.asarray(scipy.special.logsumexp(likelihood, axis=0)) for group, likelihood in self._sums.items()
        }
        total = np.sum(list(evidence.values()), axis=0)
        return {group: prior + total - likelihood for group, likelihood in evidence.items()}

    def moderated(self, number: int, misfit: float, freedom: float) -> Moderated:
        """Return the posterior variance factor of one series, from its misfit and from all other series."""
        group = self.groups[number]
        log_posterior = self._sums[group] - self._single[number] + self._likelihood(misfit, freedom, group)
        weights = log_posterior + self._other_groups[group]
        weights = np.exp(weights - weights.max())
        factors = (FREEDOM * FACTORS[:, None] * self._centres[group] + misfit) / (FREEDOM + freedom)
        relevant = (weights > 1e-9).ravel()
        freedoms = np.broadcast_to(FREEDOM + freedom, factors.shape).ravel()[relevant]
        return Moderated(
            weights.ravel()[relevant] / weights.ravel()[relevant].sum(), factors.ravel()[relevant], freedoms
        )

    def _likelihood(self, misfit: float, freedom: float, group: int) -> Real:
        """Return the log density of the F distribution over the grid; zero for a series without degrees of freedom."""
        if not freedom > 0:
            return np.zeros((len(FACTORS), len(FREEDOM)))
        ratio = max(misfit / freedom, 1e-6 * self._centres[group]) / (FACTORS[:, None] * self._centres[group])
        return np.asarray(
            0.5 * freedom * np.log(freedom * ratio / FREEDOM)
            - 0.5 * (freedom + FREEDOM) * np.log1p(freedom * ratio / FREEDOM)
            - scipy.special.betaln(freedom / 2, FREEDOM / 2)
        )
