"""Trends of modes over labels, in single poses and pooled over poses."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from millfrf.core import Real

from .identity import IdentifiedModes, ModeOfPose
from .regression import CommonVariance, Labels, Problem, dummies, shared_scatter, weighted_fit
from .sets import SetResults
from .settings import SETTINGS

FREQUENCY, DAMPING, DEPTH = "frequency", "damping ratio", "depth limit"
QUANTITIES = (FREQUENCY, DAMPING, DEPTH)


@dataclass(frozen=True)
class Series:
    """One quantity in the sets of one pose."""

    pose: str
    mode: int  # number in the campaign; 0: no mode
    frequency: float  # Hz; mean of the mode; NaN: no mode
    quantity: str  # ``frequency``, ``damping ratio`` or ``depth limit``
    rows: tuple[int, ...]  # numbers of the sets, ascending
    logs: Real  # (n,); natural logarithms of the quantity in SI units
    errors: Real  # (n,); standard errors of the fits; 0: unknown


def series_of(sets: Sequence[SetResults], modes: IdentifiedModes) -> list[Series]:
    """Return the series of all poses; leave out values of modes whose identity is uncertain."""
    number = {results.name: row for row, results in enumerate(sets)}
    series_list = [series for mode in modes.modes for series in _of_mode(sets, mode, number)]
    for pose in sorted({results.measured.pose for results in sets}):
        series_list += _of_depth(sets, pose)
    return series_list


def _of_mode(sets: Sequence[SetResults], mode: ModeOfPose, number: dict[str, int]) -> list[Series]:
    members = sorted((number[name], index) for name, index in mode.members.items() if name not in mode.doubted)
    rows = tuple(row for row, _ in members)
    values, errors = np.zeros((len(rows), 2)), np.zeros((len(rows), 2))
    for k, (row, index) in enumerate(members):
        model = sets[row].model
        assert model is not None
        values[k] = model.natural_frequencies[index], model.damping_ratios[index]
        errors[k] = [part[index] for part in sets[row].errors]
    usable = np.asarray((values > 0).all(axis=1))
    rows = tuple(rows[k] for k in np.flatnonzero(usable))
    logs, relative = np.log(values[usable]), np.nan_to_num(errors[usable] / values[usable])
    return [
        Series(mode.pose, mode.number, mode.frequency, quantity, rows, logs[:, k], relative[:, k])
        for k, quantity in enumerate((FREQUENCY, DAMPING))
        if rows
    ]


def _of_depth(sets: Sequence[SetResults], pose: str) -> list[Series]:
    limits = [
        (row, results.limit.depth)
        for row, results in enumerate(sets)
        if results.measured.pose == pose and results.limit is not None and np.isfinite(results.limit.depth)
    ]
    if not limits:
        return []
    rows = tuple(row for row, _ in limits)
    return [Series(pose, 0, np.nan, DEPTH, rows, np.log([depth for _, depth in limits]), np.zeros(len(rows)))]


@dataclass(frozen=True)
class Trend:
    """Regression of one series on one label."""

    series: Series
    label: str
    rows: tuple[int, ...]  # numbers of the sets with the label
    values: Real = field(repr=False)  # (n,); values of the label
    slope: float  # change of the logarithm per unit of the label
    error: float  # standard error of the slope with scatter between repeats
    freedom: float  # of the error
    p_value: float  # two-sided

    @property
    def change(self) -> float:
        """Relative change from the lowest to the highest value of the label."""
        return float(np.expm1(self.slope * np.ptp(self.values)))

    @property
    def half_width(self) -> float:
        """Half width of the 95 % interval of the change."""
        spread = float(scipy.stats.t.ppf(0.975, self.freedom)) * self.error * np.ptp(self.values)
        return float(spread * (1 + self.change))


def design_of(series: Series, labels: Labels, label: str | None) -> tuple[Problem, tuple[int, ...], Real] | None:
    """Set up the regression of a series on a constant, on groups and on one label.

    Return the regression, the numbers of the sets in it, and the values of the label. Return None if the label does
    not vary independently of the groups.
    """
    column = np.zeros(len(series.rows)) if label is None else labels.numbers[label][list(series.rows)]
    known = np.isfinite(column)
    rows = tuple(row for row, finite in zip(series.rows, known, strict=True) if finite)
    values = column[known]
    design = np.hstack([np.ones((len(rows), 1)), dummies(labels.texts, rows)])
    design = _independent(design)
    if label is not None:
        centred = values - (values.mean() if len(values) else 0.0)
        residual = centred - design @ np.linalg.lstsq(design, centred, rcond=None)[0]
        if len(rows) < 2 or not np.sum(residual**2) > SETTINGS.least_variation * np.sum(centred**2):
            return None
        design = np.hstack([design, centred[:, None]])
    if not 1 <= design.shape[1] <= len(rows):
        return None
    return Problem(series.logs[known], series.errors[known], design), rows, values


def trends_over(series: Sequence[Series], labels: Labels, label: str) -> list[Trend]:
    """Fit the trend over one label in every series with that label.

    All series of one mode have the same scatter beyond the stated errors. The remaining variance factor of each series
    is moderated (shrunk to the common factor). Without degrees of freedom the p-value is 1 and the error infinite.
    """
    designs = [(item, *design) for item in series if (design := design_of(item, labels, label)) is not None]
    groups = grouped([(item, problem) for item, problem, _, _ in designs])
    for_scatter = [_scatter_problems([designs[k][:2] for k in group]) for group in groups]
    scatters = [shared_scatter(problems) for problems, _ in for_scatter]
    common = common_variance([problems for problems, _ in for_scatter], scatters)
    trends, number = [], 0
    for group, (_, includes_trends), scatter in zip(groups, for_scatter, scatters, strict=True):
        for k in group:
            trends.append(_trend(label, designs[k], scatter, common, number if includes_trends else -1 - number))
            number += 1
    return trends


def grouped(problems: Sequence[tuple[Series, Problem]]) -> list[list[int]]:
    """Group the series with a common scatter: by mode and quantity, or by quantity alone if a mode has few values."""
    by_mode: dict[tuple[str, int], list[int]] = {}
    for k, (item, _) in enumerate(problems):
        by_mode.setdefault((item.quantity, item.mode), []).append(k)
    groups: dict[tuple[str, int], list[int]] = {}
    for (quantity, mode), members in sorted(by_mode.items()):
        enough = sum(problems[k][1].freedom for k in members) >= SETTINGS.own_scatter_freedom
        groups.setdefault((quantity, mode if enough else -1), []).extend(members)
    return list(groups.values())


def common_variance(groups: Sequence[Sequence[Problem]], scatters: Sequence[float]) -> CommonVariance:
    """Return the common variance model of several groups of series; each group has a scatter."""
    misfits = [weighted_fit(problem, s).misfit for group, s in zip(groups, scatters, strict=True) for problem in group]
    freedom = [problem.freedom for group in groups for problem in group]
    numbers = [number for number, group in enumerate(groups) for _ in group]
    return CommonVariance(np.array(misfits), np.array(freedom, dtype=float), numbers)


def _trend(
    label: str,
    design: tuple[Series, Problem, tuple[int, ...], Real],
    scatter: float,
    common: CommonVariance,
    number: int,
) -> Trend:
    """Fit the trend of one series.

    If ``number`` < 0, the scatter was estimated without the trend, and the misfit of this fit is not used.
    """
    series, problem, rows, values = design
    fit = weighted_fit(problem, scatter)
    included = number >= 0
    variance = common.moderated(
        number if included else -1 - number, fit.misfit if included else 0.0, problem.freedom if included else 0.0
    )
    slope, unit_error = float(fit.coefficients[-1]), float(np.sqrt(fit.covariance[-1, -1]))
    if not common.freedom.sum() - (0 if included else common.freedom[-1 - number]) > 0:
        return Trend(series, label, rows, values, slope, float("inf"), 0.0, 1.0)
    error = unit_error * float(np.sqrt(variance.factor))
    return Trend(series, label, rows, values, slope, error, variance.freedom, variance.p_value(slope / unit_error))


def _scatter_problems(chosen: Sequence[tuple[Series, Problem]]) -> tuple[list[Problem], bool]:
    """Return the regressions from which the scatter is estimated, and whether they include the trends.

    With two sets per pose, a trend leaves no degrees of freedom. Then the median trend of each mode is subtracted, and
    the remaining differences between poses count as scatter. A few poses that drift do not change the median.
    """
    problems = [problem for _, problem in chosen]
    if sum(problem.freedom for problem in problems) >= SETTINGS.scatter_freedom:
        return problems, True
    slopes: dict[tuple[str, int], list[float]] = {}
    fits = [weighted_fit(problem, 0.0).coefficients[-1] for problem in problems]
    for (series, _), slope in zip(chosen, fits, strict=True):
        slopes.setdefault((series.quantity, series.mode), []).append(float(slope))
    if max(len(common) for common in slopes.values()) < SETTINGS.scatter_poses:
        return problems, True
    pooled = []
    for (series, _), problem in zip(chosen, problems, strict=True):
        common = slopes[series.quantity, series.mode]
        logs = problem.logs - np.median(common) * problem.design[:, -1]
        pooled.append(
            Problem(logs, problem.errors, problem.design[:, : -1 if len(common) >= SETTINGS.scatter_poses else None])
        )
    return pooled, False


def _independent(design: Real) -> Real:
    """Remove columns that depend linearly on earlier columns."""
    columns: list[int] = []
    for k in range(design.shape[1]):
        if np.linalg.matrix_rank(design[:, [*columns, k]]) > len(columns):
            columns.append(k)
    return design[:, columns]


@dataclass(frozen=True)
class PooledTrend:
    """Mean slope of a quantity over one label, and its standard deviation between poses."""

    mode: int  # number in the campaign; 0: no mode
    frequency: float  # Hz; mean over these poses
    quantity: str
    label: str
    poses: int  # number of poses
    slope: float  # mean change of the logarithm per unit of the label
    error: float  # standard error with differences between poses
    between: float  # standard deviation of the slope between poses
    span: float  # median range of the label in a pose
    p_value: float  # two-sided

    @property
    def change(self) -> float:
        """Relative change over the median range of the label."""
        return float(np.expm1(self.slope * self.span))

    @property
    def half_width(self) -> float:
        """Half width of the 95 % interval of the change."""
        return float(scipy.stats.t.ppf(0.975, self.poses - 1) * self.error * self.span * (1 + self.change))


def pool(trends: Sequence[Trend]) -> PooledTrend | None:
    """Estimate the random-effects mean slope (Hartung and Knapp, Stat. Med. 20, 2001); None below three poses.

    The variance between poses is estimated by the method of Paule and Mandel, so that a single pose with a drift does
    not shift the mean significantly. The error is never smaller than the error for equal slopes.
    """
    usable = [trend for trend in trends if np.isfinite(trend.error) and trend.error > 0]
    if len(usable) < SETTINGS.pooled_poses:
        return None
    slopes, errors = np.array([trend.slope for trend in usable]), np.array([trend.error for trend in usable])
    between = _between(slopes, errors)
    weights = 1 / (errors**2 + between**2)
    slope = float(np.average(slopes, weights=weights))
    spread = float(np.sum(weights * (slopes - slope) ** 2) / (len(usable) - 1))
    error = float(np.sqrt(max(spread, 1.0) / weights.sum()))
    first = usable[0].series
    frequencies = [trend.series.frequency for trend in usable]
    span = float(np.median([np.ptp(trend.values) for trend in usable]))
    p_value = float(2 * scipy.stats.t.sf(abs(slope) / error, len(usable) - 1))
    return PooledTrend(
        first.mode,
        float(np.exp(np.mean(np.log(frequencies)))) if first.mode else float("nan"),
        first.quantity,
        usable[0].label,
        len(usable),
        slope,
        error,
        between,
        span,
        p_value,
    )


def _between(slopes: Real, errors: Real) -> float:
    """Estimate the standard deviation between poses (Paule and Mandel); 0 if the errors explain the scatter."""

    def excess(between: float) -> float:
        weights = 1 / (errors**2 + between**2)
        mean = np.average(slopes, weights=weights)
        return float(np.sum(weights * (slopes - mean) ** 2)) - (len(slopes) - 1)

    if excess(0.0) <= 0:
        return 0.0
    return float(scipy.optimize.brentq(excess, 0.0, 10 * float(np.ptp(slopes)) + 1e-300))
