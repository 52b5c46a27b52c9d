"""Sets that differ from the others of their pose, found in turn with drifts."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from .drift import FALSE_ALARMS, Drifts, find_drifts
from .moderated_variances import CommonVariance
from .regression import ErrorBarCheck, Labels, Problem, check_error_bars, shared_scatter, variances, weighted_fit
from .trends import QUANTITIES, Series, common_variance, design_of, grouped

ALL_LEVERAGE = 0.999
"""Leverage from which a value makes its own fit, and nothing says whether it is off."""

AS_FAR = 0.8
"""Share of the largest deviation from which another set may as well be the one that is off, where there are few."""


@dataclass(frozen=True)
class Deviation:
    """A quantity of one set against the other sets of its pose.

    Parameters
    ----------
    series
        The series that it belongs to.
    row
        Number of the set.
    change
        Relative deviation from what the other sets lead one to expect.
    half_width
        Half width of the 95 % interval of the deviation.
    p_value
        Probability of a deviation as large by chance, before it is adjusted for their number.
    rivals
        Numbers of the sets that may as well be the one that is off.
    """

    series: Series
    row: int
    change: float
    half_width: float
    p_value: float
    rivals: tuple[int, ...] = ()


@dataclass(frozen=True)
class Outliers:
    """Deviations that are more than chance, and how stated errors compare with the scatter of repeats.

    Parameters
    ----------
    deviations
        Deviations by set, the most certain first.
    count
        Number of values that were looked at.
    error_bars
        Check of the stated errors by quantity.
    scatter
        Relative scatter between repeats beyond the stated errors, by quantity and mode (0: no mode, -1: several).
    """

    deviations: tuple[Deviation, ...]
    count: int
    error_bars: dict[str, ErrorBarCheck] = field(repr=False)
    scatter: dict[tuple[str, int], float] = field(repr=False)


def find_outliers(series: Sequence[Series], labels: Labels, drifts: Drifts) -> Outliers:
    """Test every value against the others of its series, and name those that are more than chance among so many.

    Studentised deleted residuals (Belsley, Kuh & Welsch 1980, section 2.1) of a regression on groups and on what
    drifts.

    Parameters
    ----------
    series
        Series of all poses.
    labels
        Labels of all sets.
    drifts
        What drifts; a drift that rests on one set is not taken out, so that the set can stand off.
    """
    made = [(one, made_of) for one in series if (made_of := explained(one, labels, drifts)) is not None]
    groups = grouped(made)
    problems = [[made[k][1] for k in group] for group in groups]
    scatters = [shared_scatter(group) for group in problems]
    common = common_variance(problems, scatters)
    deviations: list[Deviation] = []
    scatter: dict[tuple[str, int], float] = {}
    number = 0
    for group, shared in zip(groups, scatters, strict=True):
        modes = {made[k][0].mode for k in group}
        scatter[made[group[0]][0].quantity, modes.pop() if len(modes) == 1 else -1] = shared
        for k in group:
            deviations += _deviations(*made[k], shared, common, number)
            number += 1
    adjusted = scipy.stats.false_discovery_control([one.p_value for one in deviations]) if deviations else np.zeros(0)
    named = [one for one, value in zip(deviations, adjusted, strict=True) if value <= FALSE_ALARMS]
    checks = {
        quantity: check_error_bars([problem for one, problem in made if one.quantity == quantity])
        for quantity in QUANTITIES
    }
    kept = [_with_rivals(one, named) for one in named]
    kept.sort(key=lambda one: (one.p_value, one.row, one.series.mode))
    return Outliers(tuple(_once(kept)), len(deviations), checks, scatter)


def explained(series: Series, labels: Labels, drifts: Drifts) -> Problem | None:
    """The regression of a series on groups and on the labels with which it was found to drift.

    Parameters
    ----------
    series
        Series to regress.
    labels
        Labels of all sets.
    drifts
        What drifts, in this pose or in all.
    """
    wanted = {
        one.trend.label
        for one in drifts.drifts
        if one.rests_on is None
        and (one.trend.series.pose, one.trend.series.mode, one.trend.series.quantity)
        == (series.pose, series.mode, series.quantity)
    }
    wanted |= {one.label for one in drifts.pooled if (one.mode, one.quantity) == (series.mode, series.quantity)}
    for label in sorted(wanted):
        found = design_of(series, labels, label)
        if found is not None and found[1] == series.rows:
            return found[0]
    found = design_of(series, labels, None)
    return None if found is None else found[0]


def _deviations(
    series: Series, problem: Problem, scatter: float, common: CommonVariance, number: int
) -> list[Deviation]:
    fit = weighted_fit(problem, scatter)
    spread = variances(problem, scatter)
    found = []
    for k in np.flatnonzero(fit.leverages < ALL_LEVERAGE):
        free = 1 - fit.leverages[k]
        own = float(fit.residuals[k] ** 2 / (spread[k] * free))
        left = problem.freedom - 1
        if not common.freedom.sum() - common.freedom[number] + left > 0:
            continue
        variance = common.moderated(number, max(fit.misfit - own, 0.0), left)
        deviation, unit = float(fit.residuals[k] / free), float(np.sqrt(spread[k] / free))
        width = float(scipy.stats.t.ppf(0.975, variance.freedom) * np.sqrt(variance.factor)) * unit * np.exp(deviation)
        p_value = variance.p_value(deviation / unit)
        found.append(Deviation(series, series.rows[k], float(np.expm1(deviation)), width, p_value))
    return found


def _with_rivals(one: Deviation, named: Sequence[Deviation]) -> Deviation:
    """Sets of the same short series that deviate about as far: two or three sets do not tell which is off."""
    if len(one.series.rows) > 3:
        return one
    same = [other for other in named if other.series is one.series and other.row != one.row]
    rivals = tuple(other.row for other in same if abs(np.log1p(other.change)) > AS_FAR * abs(np.log1p(one.change)))
    return replace(one, rivals=rivals)


def _once(deviations: Sequence[Deviation]) -> list[Deviation]:
    """Of sets that may each be the one that is off, one line; of three sets, the one that is farthest off."""
    kept: list[Deviation] = []
    for one in deviations:
        same = [other for other in kept if other.series is one.series]
        if len(one.series.rows) > 3 or not same:
            kept.append(one)
    return kept


def drifts_and_outliers(series: Sequence[Series], labels: Labels) -> tuple[Drifts, Outliers]:
    """Find what drifts, then what stands off; then what drifts without the values that stand off.

    Parameters
    ----------
    series
        Series of all poses.
    labels
        Labels of all sets.
    """
    drifts = find_drifts(series, labels)
    outliers = find_outliers(series, labels, drifts)
    if not any(not one.rivals for one in outliers.deviations):
        return drifts, outliers
    drifts = find_drifts(without(series, outliers), labels)
    return drifts, find_outliers(series, labels, drifts)


def without(series: Sequence[Series], outliers: Outliers) -> list[Series]:
    """The series without the values that stand off; where it cannot be told which one does, both stay.

    Parameters
    ----------
    series
        Series of all poses.
    outliers
        Deviations that were found.
    """
    off = {(id(one.series), one.row) for one in outliers.deviations if not one.rivals}
    found = []
    for one in series:
        kept = np.array([(id(one), row) not in off for row in one.rows], dtype=bool)
        rows = tuple(one.rows[k] for k in np.flatnonzero(kept))
        found.append(one if kept.all() else replace(one, rows=rows, logs=one.logs[kept], errors=one.errors[kept]))
    return [one for one in found if one.rows]
