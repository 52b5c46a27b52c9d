"""Outlying sets: tests of each set against the others of its pose, alternating with drifts."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from .drift import Drifts, find_drifts
from .regression import (
    CommonVariance,
    ErrorBarCheck,
    Labels,
    Problem,
    check_error_bars,
    shared_scatter,
    variances,
    weighted_fit,
)
from .settings import SETTINGS
from .trends import QUANTITIES, Series, common_variance, design_of, grouped


@dataclass(frozen=True)
class Deviation:
    """Deviation of one quantity of a set from the other sets of its pose."""

    series: Series
    row: int  # number of the set
    change: float  # relative deviation from the prediction by the other sets
    half_width: float  # half width of the 95 % interval of the deviation
    p_value: float  # before the adjustment for multiple tests
    rivals: tuple[int, ...] = ()  # numbers of the sets that may be the outlier instead


@dataclass(frozen=True)
class Outliers:
    """Significant deviations, and a comparison of stated errors with the scatter of repeats."""

    deviations: tuple[Deviation, ...]  # by p-value
    count: int  # number of tested values
    error_bars: dict[str, ErrorBarCheck] = field(repr=False)  # by quantity
    # relative scatter between repeats beyond the stated errors, by quantity and mode (0: no mode, -1: several)
    scatter: dict[tuple[str, int], float] = field(repr=False)


def find_outliers(series: Sequence[Series], labels: Labels, drifts: Drifts) -> Outliers:
    """Test every value against the other values of its series, with control of the false discovery rate.

    The values tested are studentised deleted residuals (Belsley, Kuh & Welsch 1980, section 2.1) of a regression on
    groups and on labels with a drift.
    """
    regressions = [(item, problem_of) for item in series if (problem_of := explained(item, labels, drifts)) is not None]
    groups = grouped(regressions)
    problems = [[regressions[k][1] for k in group] for group in groups]
    scatters = [shared_scatter(group) for group in problems]
    common = common_variance(problems, scatters)
    deviations: list[Deviation] = []
    scatter: dict[tuple[str, int], float] = {}
    number = 0
    for group, shared in zip(groups, scatters, strict=True):
        modes = {regressions[k][0].mode for k in group}
        scatter[regressions[group[0]][0].quantity, modes.pop() if len(modes) == 1 else -1] = shared
        for k in group:
            deviations += _deviations(*regressions[k], shared, common, number)
            number += 1
    adjusted = scipy.stats.false_discovery_control([item.p_value for item in deviations]) if deviations else np.zeros(0)
    rejected = [
        item for item, value in zip(deviations, adjusted, strict=True) if value <= SETTINGS.false_discovery_rate
    ]
    checks = {
        quantity: check_error_bars([problem for item, problem in regressions if item.quantity == quantity])
        for quantity in QUANTITIES
    }
    outliers = [_with_rivals(item, rejected) for item in rejected]
    outliers.sort(key=lambda item: (item.p_value, item.row, item.series.mode))
    return Outliers(tuple(_once(outliers)), len(deviations), checks, scatter)


def explained(series: Series, labels: Labels, drifts: Drifts) -> Problem | None:
    """Return the regression of a series on groups and on the label of its drift."""
    drift_labels = {
        drift.trend.label
        for drift in drifts.drifts
        if drift.rests_on is None
        and (drift.trend.series.pose, drift.trend.series.mode, drift.trend.series.quantity)
        == (series.pose, series.mode, series.quantity)
    }
    drift_labels |= {
        drift.label for drift in drifts.pooled if (drift.mode, drift.quantity) == (series.mode, series.quantity)
    }
    for label in sorted(drift_labels):
        design = design_of(series, labels, label)
        if design is not None and design[1] == series.rows:
            return design[0]
    design = design_of(series, labels, None)
    return None if design is None else design[0]


def _deviations(
    series: Series, problem: Problem, scatter: float, common: CommonVariance, number: int
) -> list[Deviation]:
    fit = weighted_fit(problem, scatter)
    spread = variances(problem, scatter)
    deviations = []
    for k in np.flatnonzero(fit.leverages < SETTINGS.largest_leverage):
        free = 1 - fit.leverages[k]
        own_misfit = float(fit.residuals[k] ** 2 / (spread[k] * free))
        freedom = problem.freedom - 1
        if not common.freedom.sum() - common.freedom[number] + freedom > 0:
            continue
        variance = common.moderated(number, max(fit.misfit - own_misfit, 0.0), freedom)
        deviation, unit_error = float(fit.residuals[k] / free), float(np.sqrt(spread[k] / free))
        width = (
            float(scipy.stats.t.ppf(0.975, variance.freedom) * np.sqrt(variance.factor))
            * unit_error
            * np.exp(deviation)
        )
        p_value = variance.p_value(deviation / unit_error)
        deviations.append(Deviation(series, series.rows[k], float(np.expm1(deviation)), width, p_value))
    return deviations


def _with_rivals(deviation: Deviation, rejected: Sequence[Deviation]) -> Deviation:
    """Add the sets that may be the outlier instead: in a series of two or three sets the outlier is ambiguous."""
    if len(deviation.series.rows) > 3:
        return deviation
    in_series = [other for other in rejected if other.series is deviation.series and other.row != deviation.row]
    rivals = tuple(
        other.row
        for other in in_series
        if abs(np.log1p(other.change)) > SETTINGS.rival_share * abs(np.log1p(deviation.change))
    )
    return replace(deviation, rivals=rivals)


def _once(deviations: Sequence[Deviation]) -> list[Deviation]:
    """Keep only the most significant deviation of each short series."""
    first: list[Deviation] = []
    for deviation in deviations:
        in_series = [other for other in first if other.series is deviation.series]
        if len(deviation.series.rows) > 3 or not in_series:
            first.append(deviation)
    return first


def drifts_and_outliers(series: Sequence[Series], labels: Labels) -> tuple[Drifts, Outliers]:
    """Find drifts and outliers; then search for drifts again without the outliers."""
    drifts = find_drifts(series, labels)
    outliers = find_outliers(series, labels, drifts)
    if not any(not deviation.rivals for deviation in outliers.deviations):
        return drifts, outliers
    drifts = find_drifts(without(series, outliers), labels)
    return drifts, find_outliers(series, labels, drifts)


def without(series: Sequence[Series], outliers: Outliers) -> list[Series]:
    """Remove the outliers from the series; keep ambiguous outliers."""
    removed = {(id(item.series), item.row) for item in outliers.deviations if not item.rivals}
    cleaned = []
    for item in series:
        mask = np.array([(id(item), row) not in removed for row in item.rows], dtype=bool)
        rows = tuple(item.rows[k] for k in np.flatnonzero(mask))
        cleaned.append(item if mask.all() else replace(item, rows=rows, logs=item.logs[mask], errors=item.errors[mask]))
    return [item for item in cleaned if item.rows]
