"""Drifts in a campaign: trends beyond chance among all that were tested."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from .regression import Labels, Problem, weighted_fit
from .trends import PooledTrend, Series, Trend, pool, trends_over

FALSE_ALARMS = 0.025
"""Expected share of false ones among the drifts that are named; without any drift, the chance of naming one. It is half
of what is promised (5 %), because scatter that differs much between poses raises it."""

SUSPECT = 0.0027
"""Probability of a single trend from which it is worth another measurement: three standard errors."""

AS_GOOD = 4.0
"""Difference of misfit up to which two labels explain a trend equally well: two standard errors."""

ALIKE = 0.5
"""Correlation of two labels in a pose from which one may stand for the other."""

OWN_ALARMS = 0.05
"""Share of campaigns that may call the drift of some pose its own where all poses drift alike but for their scatter."""

RESTS, HELD = 0.3, 1.5
"""Share of a slope, and standard errors, below which it falls without the one set that it rests on."""

POWER = 0.8
"""Probability with which the smallest change that is told of would have been found."""


@dataclass(frozen=True)
class Drift:
    """A trend that is more than chance.

    Parameters
    ----------
    trend
        The trend over the label that explains it best.
    adjusted
        Its probability, adjusted for all trends that were looked at (false discovery rate).
    others
        Mean trend of the same mode over the same label in the other poses; None: there are fewer than three.
    as_good
        Other labels that explain it as well, with their correlation with this one in the pose.
    rests_on
        Number of the set without which there is no trend, or None.
    own
        Whether the pose drifts otherwise than the other poses do, see :func:`drifts_apart`.
    """

    trend: Trend
    adjusted: float
    others: PooledTrend | None
    as_good: tuple[tuple[str, float], ...]
    rests_on: int | None
    own: bool = False


def drifts_apart(trend: Trend, others: PooledTrend, among: int) -> bool:
    """Whether a trend lies outside what the trends of the other poses lead one to expect.

    ``|b - m| > t sqrt(s_b^2 + s_m^2 + tau^2)`` with slope b and error s_b of the pose, mean m of the others, its error
    s_m and the scatter tau of slopes between them: the prediction interval of a random-effects mean (Higgins, Thompson
    & Spiegelhalter, J. R. Stat. Soc. A 172, 2009). t has one degree of freedom less than there are others, since few
    poses tell tau badly, and a level of :data:`OWN_ALARMS` over the number of drifts (Bonferroni).

    Parameters
    ----------
    trend
        Trend of the pose.
    others
        Mean trend of the others.
    among
        Number of drifts that are compared so.
    """
    spread = float(np.hypot(np.hypot(trend.error, others.error), others.between))
    p_value = 2 * scipy.stats.t.sf(abs(trend.slope - others.slope) / spread, others.poses - 1)
    return bool(p_value <= OWN_ALARMS / among)


@dataclass(frozen=True)
class Drifts:
    """Everything that was looked at for drift, and what was found.

    Parameters
    ----------
    drifts
        Trends of single poses that are more than chance, one a mode and quantity; those of a pose's own come first,
        then the most certain.
    pooled
        Mean trends over poses that are more than chance.
    suspects
        Trends that would be three standard errors alone, and are no more than chance among so many.
    all_trends, all_pooled
        Everything that was looked at.
    smallest
        Relative change from end to end that would have been found with 80 % in the typical pose, by quantity and label.
    """

    drifts: tuple[Drift, ...]
    pooled: tuple[PooledTrend, ...]
    suspects: tuple[Trend, ...]
    all_trends: tuple[Trend, ...] = field(repr=False)
    all_pooled: tuple[PooledTrend, ...] = field(repr=False)
    smallest: tuple[tuple[str, str, float], ...] = ()

    @property
    def count(self) -> int:
        """Number of trends that were looked at."""
        return len(self.all_trends) + len(self.all_pooled)


def find_drifts(series: Sequence[Series], labels: Labels) -> Drifts:
    """Test the trends of all series over all labels, in each pose and over poses.

    Benjamini and Hochberg (J. R. Stat. Soc. B 57, 1995) over all of them: among the named ones at most 5 % are false
    on average, and without any drift the chance of naming one is 5 %.

    Parameters
    ----------
    series
        Series of all poses.
    labels
        Labels of all sets.
    """
    trends = [one for label in sorted(labels.numbers) for one in trends_over(series, labels, label)]
    trends = [one for one in trends if np.isfinite(one.error)]
    pooled = [found for group in _by_mode(trends) if (found := pool(group)) is not None]
    probabilities = np.array([one.p_value for one in trends] + [one.p_value for one in pooled])
    adjusted = scipy.stats.false_discovery_control(probabilities) if len(probabilities) else probabilities
    named = adjusted <= FALSE_ALARMS
    best: dict[tuple[str, int, str], tuple[Trend, float]] = {}
    for one, value, taken in zip(trends, adjusted[: len(trends)], named[: len(trends)], strict=True):
        key = _key(one.series)
        if taken and (key not in best or one.p_value < best[key][0].p_value):
            best[key] = (one, float(value))
    drifts = _with_own([_drift(one, value, trends, labels) for one, value in best.values()])
    suspects = [one for one in trends if one.p_value < SUSPECT and _key(one.series) not in best]
    return Drifts(
        tuple(
            sorted(
                drifts, key=lambda one: (not one.own, one.trend.p_value, one.trend.series.pose, one.trend.series.mode)
            )
        ),
        tuple(one for one, taken in zip(pooled, named[len(trends) :], strict=True) if taken),
        tuple(sorted(suspects, key=lambda one: one.p_value)),
        tuple(trends),
        tuple(pooled),
        _smallest(trends, len(probabilities)),
    )


def _key(series: Series) -> tuple[str, int, str]:
    return series.pose, series.mode, series.quantity


def _by_mode(trends: Sequence[Trend]) -> list[list[Trend]]:
    groups: dict[tuple[int, str, str], list[Trend]] = {}
    for one in trends:
        groups.setdefault((one.series.mode, one.series.quantity, one.label), []).append(one)
    return list(groups.values())


def _drift(trend: Trend, adjusted: float, trends: Sequence[Trend], labels: Labels) -> Drift:
    beside = [
        one
        for one in trends
        if one.label == trend.label
        and (one.series.mode, one.series.quantity) == (trend.series.mode, trend.series.quantity)
        and one.series.pose != trend.series.pose
    ]
    return Drift(trend, adjusted, pool(beside), _as_good(trend, trends, labels), _rests_on(trend))


def _with_own(drifts: Sequence[Drift]) -> list[Drift]:
    """The drifts, with the answer whether each is its pose's own; with nothing to compare with it is not told so."""
    among = sum(one.others is not None for one in drifts)
    return [
        one if one.others is None else replace(one, own=drifts_apart(one.trend, one.others, among)) for one in drifts
    ]


def _as_good(trend: Trend, trends: Sequence[Trend], labels: Labels) -> tuple[tuple[str, float], ...]:
    """Labels that move with the trend's and leave no larger misfit.

    The misfits are told by the trends' own t-values: the drop of the misfit that a column brings is t squared.
    """
    found = []
    for one in trends:
        if _key(one.series) != _key(trend.series) or one.label == trend.label or one.rows != trend.rows:
            continue
        correlation = float(np.corrcoef(one.values, trend.values)[0, 1])
        lost = (trend.slope / trend.error) ** 2 - (one.slope / one.error) ** 2
        if abs(correlation) >= ALIKE and lost < AS_GOOD:
            found.append((one.label, correlation))
    return tuple(found)


def _rests_on(trend: Trend) -> int | None:
    """The set without which little of the slope is left, or less than its error."""
    if len(trend.rows) < 3:
        return None
    left = []
    for k in range(len(trend.rows)):
        kept = np.arange(len(trend.rows)) != k
        values = trend.values[kept]
        if np.ptp(values) == 0:
            continue
        rows = np.array([row in trend.rows for row in trend.series.rows])
        rows[np.flatnonzero(rows)[k]] = False
        design = np.stack([np.ones(kept.sum()), values - values.mean()], axis=1)
        problem = Problem(trend.series.logs[rows], trend.series.errors[rows], design)
        slope = float(weighted_fit(problem, 0.0).coefficients[-1])
        wider = np.sqrt(np.sum((trend.values - trend.values.mean()) ** 2) / np.sum((values - values.mean()) ** 2))
        share = slope / trend.slope
        enough = max(RESTS, HELD * trend.error * wider / abs(trend.slope))
        left.append((share / enough, trend.rows[k]))
    share, row = min(left, default=(1.0, -1))
    return row if share < 1 else None


def _smallest(trends: Sequence[Trend], count: int) -> tuple[tuple[str, str, float], ...]:
    """Smallest change that the typical pose would have shown with 80 %, were it the only one that changes."""
    groups: dict[tuple[str, str], list[float]] = {}
    for one in trends:
        far = scipy.stats.t.isf(FALSE_ALARMS / (2 * count), one.freedom) + scipy.stats.t.ppf(POWER, one.freedom)
        groups.setdefault((one.series.quantity, one.label), []).append(float(far * one.error * np.ptp(one.values)))
    return tuple((quantity, label, float(np.median(found))) for (quantity, label), found in sorted(groups.items()))
