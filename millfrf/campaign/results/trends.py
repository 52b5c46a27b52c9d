"""Trends of modes over labels, in one pose and in all poses together."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy

from millfrf.core import Real

from .identity import IdentifiedModes, ModeOfPose
from .moderated_variances import CommonVariance
from .regression import Labels, Problem, dummies, shared_scatter, weighted_fit
from .sets import SetResults

FREQUENCY, DAMPING, DEPTH = "frequency", "damping ratio", "depth limit"
QUANTITIES = (FREQUENCY, DAMPING, DEPTH)


@dataclass(frozen=True)
class Series:
    """One quantity through the sets of a pose.

    Parameters
    ----------
    pose
        Name of the pose.
    mode
        Number of the mode in the campaign; 0: the quantity belongs to no mode.
    frequency : Hz
        Mean natural frequency of the mode; NaN without a mode.
    quantity
        ``frequency``, ``damping ratio`` or ``depth limit``.
    rows
        Numbers of the sets, rising.
    logs : (n,)
        Natural logarithms of the quantity in SI units.
    errors : (n,)
        Their standard errors as the fits state them; 0 where none is known.
    """

    pose: str
    mode: int
    frequency: float
    quantity: str
    rows: tuple[int, ...]
    logs: Real
    errors: Real


def series_of(sets: Sequence[SetResults], modes: IdentifiedModes) -> list[Series]:
    """Collect the series of all poses; a mode that may be another one in a set is left out there.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    modes
        Which modes are the same.
    """
    number = {one.name: row for row, one in enumerate(sets)}
    found = [series for mode in modes.modes for series in _of_mode(sets, mode, number)]
    for pose in sorted({one.measured.pose for one in sets}):
        found += _of_depth(sets, pose)
    return found


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
    known = [
        (row, one.limit.depth)
        for row, one in enumerate(sets)
        if one.measured.pose == pose and one.limit is not None and np.isfinite(one.limit.depth)
    ]
    if not known:
        return []
    rows = tuple(row for row, _ in known)
    return [Series(pose, 0, np.nan, DEPTH, rows, np.log([depth for _, depth in known]), np.zeros(len(rows)))]


ENOUGH = 8
"""Degrees of freedom from which the series of one mode have a scatter of their own; below, all modes share one."""

FEWEST, TREND_POSES = 4, 4
"""Degrees of freedom below which trends do not tell the scatter, and poses of a mode whose differences then do."""

LEAST_VARIATION = 1e-3
"""Share of a label's variance that its groups and the constant must leave, so that a trend over it is defined."""


@dataclass(frozen=True)
class Trend:
    """A quantity of one mode in one pose against one label.

    Parameters
    ----------
    series
        The series that was fitted.
    label
        Name of the label.
    rows
        Numbers of the sets that have the label.
    values : (n,)
        The label in these sets.
    slope, error
        Change of the logarithm a unit of the label, and its standard error, scatter between repeats included.
    freedom
        Degrees of freedom of the error.
    p_value
        Two-sided probability of a slope as large where there is none.
    """

    series: Series
    label: str
    rows: tuple[int, ...]
    values: Real = field(repr=False)
    slope: float
    error: float
    freedom: float
    p_value: float

    @property
    def change(self) -> float:
        """Relative change from the lowest to the highest value of the label, by the trend."""
        return float(np.expm1(self.slope * np.ptp(self.values)))

    @property
    def half_width(self) -> float:
        """Half width of the 95 % interval of the change."""
        spread = float(scipy.stats.t.ppf(0.975, self.freedom)) * self.error * np.ptp(self.values)
        return float(spread * (1 + self.change))


def design_of(series: Series, labels: Labels, label: str | None) -> tuple[Problem, tuple[int, ...], Real] | None:
    """The regression of a series on a constant, groups and one label; None where it is not defined.

    Parameters
    ----------
    series
        Series to regress.
    labels
        Labels of all sets.
    label
        Label whose trend is wanted, last of the columns; None: constant and groups alone.

    Returns
    -------
    Problem, numbers of the sets that have the label, and the label's values there.
    """
    column = np.zeros(len(series.rows)) if label is None else labels.numbers[label][list(series.rows)]
    known = np.isfinite(column)
    rows = tuple(row for row, good in zip(series.rows, known, strict=True) if good)
    values = column[known]
    design = np.hstack([np.ones((len(rows), 1)), dummies(labels.texts, rows)])
    design = _independent(design)
    if label is not None:
        centred = values - (values.mean() if len(values) else 0.0)
        beside = centred - design @ np.linalg.lstsq(design, centred, rcond=None)[0]
        if len(rows) < 2 or not np.sum(beside**2) > LEAST_VARIATION * np.sum(centred**2):
            return None
        design = np.hstack([design, centred[:, None]])
    if not 1 <= design.shape[1] <= len(rows):
        return None
    return Problem(series.logs[known], series.errors[known], design), rows, values


def trends_over(series: Sequence[Series], labels: Labels, label: str) -> list[Trend]:
    """Fit the trend over one label in every series that has it.

    Scatter beyond the stated errors is shared by the series of a mode over poses; what is left differs between series
    and is drawn towards what they have in common. A series that nothing is known of (two sets, and no other series
    with more) has a p-value of one and an infinite error.

    Parameters
    ----------
    series
        Series of the campaign.
    labels
        Labels of all sets.
    label
        Label whose trends are wanted.
    """
    made = [(one, *design) for one in series if (design := design_of(one, labels, label)) is not None]
    groups = grouped([(one, problem) for one, problem, _, _ in made])
    telling = [_telling([made[k][:2] for k in group]) for group in groups]
    scatters = [shared_scatter(problems) for problems, _ in telling]
    common = common_variance([problems for problems, _ in telling], scatters)
    found, number = [], 0
    for group, (_, own), scatter in zip(groups, telling, scatters, strict=True):
        for k in group:
            found.append(_trend(label, made[k], scatter, common, number if own else -1 - number))
            number += 1
    return found


def grouped(problems: Sequence[tuple[Series, Problem]]) -> list[list[int]]:
    """Numbers of the series that share a scatter: those of one mode and quantity, or all of a quantity with few."""
    by_mode: dict[tuple[str, int], list[int]] = {}
    for k, (one, _) in enumerate(problems):
        by_mode.setdefault((one.quantity, one.mode), []).append(k)
    groups: dict[tuple[str, int], list[int]] = {}
    for (quantity, mode), members in sorted(by_mode.items()):
        enough = sum(problems[k][1].freedom for k in members) >= ENOUGH
        groups.setdefault((quantity, mode if enough else -1), []).extend(members)
    return list(groups.values())


def common_variance(groups: Sequence[Sequence[Problem]], scatters: Sequence[float]) -> CommonVariance:
    """Common variance of the series of several groups, in their order, each with the scatter of its group.

    Parameters
    ----------
    groups
        Regressions of each group.
    scatters
        Scatter of each group beyond the stated errors.
    """
    misfits = [weighted_fit(one, s).misfit for group, s in zip(groups, scatters, strict=True) for one in group]
    freedom = [one.freedom for group in groups for one in group]
    numbers = [number for number, group in enumerate(groups) for _ in group]
    return CommonVariance(np.array(misfits), np.array(freedom, dtype=float), numbers)


def _trend(
    label: str,
    made: tuple[Series, Problem, tuple[int, ...], Real],
    scatter: float,
    common: CommonVariance,
    number: int,
) -> Trend:
    """The trend of one series; ``number`` below zero: what tells the scatter holds the trend, so it counts not."""
    series, problem, rows, values = made
    fit = weighted_fit(problem, scatter)
    own = number >= 0
    variance = common.moderated(
        number if own else -1 - number, fit.misfit if own else 0.0, problem.freedom if own else 0.0
    )
    slope, unit = float(fit.coefficients[-1]), float(np.sqrt(fit.covariance[-1, -1]))
    if not common.freedom.sum() - (0 if own else common.freedom[-1 - number]) > 0:
        return Trend(series, label, rows, values, slope, float("inf"), 0.0, 1.0)
    error = unit * float(np.sqrt(variance.factor))
    return Trend(series, label, rows, values, slope, error, variance.freedom, variance.p_value(slope / unit))


def _telling(chosen: Sequence[tuple[Series, Problem]]) -> tuple[list[Problem], bool]:
    """Regressions that tell the scatter: those of the trends, or, where two sets a pose leave nothing, the poses'.

    The second take out the median trend of each mode; how the poses differ about it is then the scatter, of which a
    few that drift change little. The answer says whether they are the trends' own.
    """
    own = [problem for _, problem in chosen]
    if sum(one.freedom for one in own) >= FEWEST:
        return own, True
    slopes: dict[tuple[str, int], list[float]] = {}
    fits = [weighted_fit(one, 0.0).coefficients[-1] for one in own]
    for (series, _), slope in zip(chosen, fits, strict=True):
        slopes.setdefault((series.quantity, series.mode), []).append(float(slope))
    if max(len(common) for common in slopes.values()) < TREND_POSES:
        return own, True
    told = []
    for (series, _), problem in zip(chosen, own, strict=True):
        common = slopes[series.quantity, series.mode]
        logs = problem.logs - np.median(common) * problem.design[:, -1]
        told.append(Problem(logs, problem.errors, problem.design[:, : -1 if len(common) >= TREND_POSES else None]))
    return told, False


def _independent(design: Real) -> Real:
    """Columns that do not follow from those before them."""
    kept: list[int] = []
    for k in range(design.shape[1]):
        if np.linalg.matrix_rank(design[:, [*kept, k]]) > len(kept):
            kept.append(k)
    return design[:, kept]


POOLED_POSES = 3
"""Poses without which a trend of all is not told from one of each."""


@dataclass(frozen=True)
class PooledTrend:
    """Mean slope of a mode's quantity over one label, and how it differs between poses.

    Parameters
    ----------
    mode, frequency
        Number of the mode in the campaign, and its mean natural frequency over these poses, Hz.
    quantity, label
        Quantity that changes, and the label.
    poses
        Number of poses.
    slope, error
        Mean change of the logarithm a unit of the label, and its standard error, differences between poses included.
    between
        Standard deviation of the slope between poses.
    span
        Median range of the label in a pose.
    p_value
        Two-sided probability of a mean slope as large where there is none.
    """

    mode: int
    frequency: float
    quantity: str
    label: str
    poses: int
    slope: float
    error: float
    between: float
    span: float
    p_value: float

    @property
    def change(self) -> float:
        """Relative change over the median range of the label."""
        return float(np.expm1(self.slope * self.span))

    @property
    def half_width(self) -> float:
        """Half width of the 95 % interval of the change."""
        return float(scipy.stats.t.ppf(0.975, self.poses - 1) * self.error * self.span * (1 + self.change))


def pool(trends: Sequence[Trend]) -> PooledTrend | None:
    """Mean slope over poses with the interval of Hartung and Knapp (Stat. Med. 20, 2001); None below three poses.

    Slopes differ between poses with a variance after Paule and Mandel, so that one pose that drifts does not make all
    of them drift. The error is never smaller than that of equal slopes.

    Parameters
    ----------
    trends
        Trends of one mode's quantity over one label, one a pose.
    """
    told = [one for one in trends if np.isfinite(one.error) and one.error > 0]
    if len(told) < POOLED_POSES:
        return None
    slopes, errors = np.array([one.slope for one in told]), np.array([one.error for one in told])
    between = _between(slopes, errors)
    weights = 1 / (errors**2 + between**2)
    slope = float(np.average(slopes, weights=weights))
    spread = float(np.sum(weights * (slopes - slope) ** 2) / (len(told) - 1))
    error = float(np.sqrt(max(spread, 1.0) / weights.sum()))
    first = told[0].series
    frequencies = [one.series.frequency for one in told]
    span = float(np.median([np.ptp(one.values) for one in told]))
    p_value = float(2 * scipy.stats.t.sf(abs(slope) / error, len(told) - 1))
    return PooledTrend(
        first.mode,
        float(np.exp(np.mean(np.log(frequencies)))) if first.mode else float("nan"),
        first.quantity,
        told[0].label,
        len(told),
        slope,
        error,
        between,
        span,
        p_value,
    )


def _between(slopes: Real, errors: Real) -> float:
    """Standard deviation between poses with which the slopes scatter as they should; 0 where errors explain it."""

    def excess(between: float) -> float:
        weights = 1 / (errors**2 + between**2)
        mean = np.average(slopes, weights=weights)
        return float(np.sum(weights * (slopes - mean) ** 2)) - (len(slopes) - 1)

    if excess(0.0) <= 0:
        return 0.0
    return float(scipy.optimize.brentq(excess, 0.0, 10 * float(np.ptp(slopes)) + 1e-300))
