"""Drifts in a campaign: significant trends among all tested trends."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import scipy

from .regression import Labels, Problem, weighted_fit
from .settings import SETTINGS
from .trends import PooledTrend, Series, Trend, pool, trends_over


@dataclass(frozen=True)
class Drift:
    """A significant trend."""

    trend: Trend  # over the label with the smallest p-value
    adjusted: float  # p-value adjusted for the false discovery rate
    others: PooledTrend | None  # mean trend in the other poses; None: fewer than three
    as_good: tuple[tuple[str, float], ...]  # labels that explain it equally well, with their correlation
    rests_on: int | None  # number of the set without which there is no trend
    own: bool = False  # the pose drifts differently from the other poses, see :func:`drifts_apart`


def drifts_apart(trend: Trend, others: PooledTrend, among: int) -> bool:
    """Return whether the trend of a pose lies outside the prediction interval computed from the other poses.

    The trend lies outside if ``|b - m| > t sqrt(s_b^2 + s_m^2 + tau^2)``. The pose has the slope b with error s_b; the
    other poses have the mean slope m with error s_m and the scatter tau (Higgins, Thompson & Spiegelhalter, J. R.
    Stat. Soc. A 172, 2009). The degrees of freedom of t are the number of other poses minus one, because few poses
    determine tau badly. The level is ``own_drift_level`` divided by the number ``among`` of drifts (Bonferroni).
    """
    spread = float(np.hypot(np.hypot(trend.error, others.error), others.between))
    p_value = 2 * scipy.stats.t.sf(abs(trend.slope - others.slope) / spread, others.poses - 1)
    return bool(p_value <= SETTINGS.own_drift_level / among)


@dataclass(frozen=True)
class Drifts:
    """Tested trends and significant drifts."""

    # one for each pose, mode and quantity; first those that differ from the other poses, then by p-value
    drifts: tuple[Drift, ...]
    pooled: tuple[PooledTrend, ...]  # significant mean trends over poses
    suspects: tuple[Trend, ...]  # beyond three standard errors, but not significant among all
    all_trends: tuple[Trend, ...] = field(repr=False)  # all tested trends
    all_pooled: tuple[PooledTrend, ...] = field(repr=False)
    # quantity, label, and relative change over the range of the label that the median pose detects with 80 % power
    smallest: tuple[tuple[str, str, float], ...] = ()

    @property
    def count(self) -> int:
        """Number of tested trends."""
        return len(self.all_trends) + len(self.all_pooled)


def find_drifts(series: Sequence[Series], labels: Labels) -> Drifts:
    """Test the trends of all series over all labels, in each pose and over poses.

    The false discovery rate is controlled (Benjamini and Hochberg, J. R. Stat. Soc. B 57, 1995): on average at most
    5 % of the drifts found are false. If no drift exists, the probability that the test finds a drift is at most 5 %.
    """
    trends = [trend for label in sorted(labels.numbers) for trend in trends_over(series, labels, label)]
    trends = [trend for trend in trends if np.isfinite(trend.error)]
    pooled = [result for group in _by_mode(trends) if (result := pool(group)) is not None]
    probabilities = np.array([trend.p_value for trend in trends] + [trend.p_value for trend in pooled])
    adjusted = scipy.stats.false_discovery_control(probabilities) if len(probabilities) else probabilities
    rejected = adjusted <= SETTINGS.false_discovery_rate
    best: dict[tuple[str, int, str], tuple[Trend, float]] = {}
    for trend, value, significant in zip(trends, adjusted[: len(trends)], rejected[: len(trends)], strict=True):
        key = _key(trend.series)
        if significant and (key not in best or trend.p_value < best[key][0].p_value):
            best[key] = (trend, float(value))
    drifts = _with_own([_drift(trend, value, trends) for trend, value in best.values()])
    suspects = [
        trend for trend in trends if trend.p_value < SETTINGS.suspect_p_value and _key(trend.series) not in best
    ]
    return Drifts(
        tuple(
            sorted(
                drifts,
                key=lambda trend: (
                    not trend.own,
                    trend.trend.p_value,
                    trend.trend.series.pose,
                    trend.trend.series.mode,
                ),
            )
        ),
        tuple(trend for trend, significant in zip(pooled, rejected[len(trends) :], strict=True) if significant),
        tuple(sorted(suspects, key=lambda trend: trend.p_value)),
        tuple(trends),
        tuple(pooled),
        _smallest(trends, len(probabilities)),
    )


def _key(series: Series) -> tuple[str, int, str]:
    return series.pose, series.mode, series.quantity


def _by_mode(trends: Sequence[Trend]) -> list[list[Trend]]:
    groups: dict[tuple[int, str, str], list[Trend]] = {}
    for trend in trends:
        groups.setdefault((trend.series.mode, trend.series.quantity, trend.label), []).append(trend)
    return list(groups.values())


def _drift(trend: Trend, adjusted: float, trends: Sequence[Trend]) -> Drift:
    other_poses = [
        other
        for other in trends
        if other.label == trend.label
        and (other.series.mode, other.series.quantity) == (trend.series.mode, trend.series.quantity)
        and other.series.pose != trend.series.pose
    ]
    return Drift(trend, adjusted, pool(other_poses), _as_good(trend, trends), _rests_on(trend))


def _with_own(drifts: Sequence[Drift]) -> list[Drift]:
    """Set the field ``own`` of each drift that can be compared with other poses."""
    n_compared = sum(drift.others is not None for drift in drifts)
    return [
        drift if drift.others is None else replace(drift, own=drifts_apart(drift.trend, drift.others, n_compared))
        for drift in drifts
    ]


def _as_good(trend: Trend, trends: Sequence[Trend]) -> tuple[tuple[str, float], ...]:
    """Return the correlated labels that explain the trend about as well.

    Each label reduces chi-square by its t-value squared, so the t-values show which labels explain equally well.
    """
    rivals = []
    for other in trends:
        if _key(other.series) != _key(trend.series) or other.label == trend.label or other.rows != trend.rows:
            continue
        correlation = float(np.corrcoef(other.values, trend.values)[0, 1])
        increase = (trend.slope / trend.error) ** 2 - (other.slope / other.error) ** 2
        if abs(correlation) >= SETTINGS.confounded_correlation and increase < SETTINGS.equal_misfit:
            rivals.append((other.label, correlation))
    return tuple(rivals)


def _rests_on(trend: Trend) -> int | None:
    """Return the set without which the slope is small or not significant; None if there is no such set."""
    if len(trend.rows) < 3:
        return None
    shares = []
    for k in range(len(trend.rows)):
        others = np.arange(len(trend.rows)) != k
        values = trend.values[others]
        if np.ptp(values) == 0:
            continue
        rows = np.array([row in trend.rows for row in trend.series.rows])
        rows[np.flatnonzero(rows)[k]] = False
        design = np.stack([np.ones(others.sum()), values - values.mean()], axis=1)
        problem = Problem(trend.series.logs[rows], trend.series.errors[rows], design)
        slope = float(weighted_fit(problem, 0.0).coefficients[-1])
        error_ratio = np.sqrt(np.sum((trend.values - trend.values.mean()) ** 2) / np.sum((values - values.mean()) ** 2))
        share = slope / trend.slope
        least = max(
            SETTINGS.single_set_share, SETTINGS.single_set_errors * trend.error * error_ratio / abs(trend.slope)
        )
        shares.append((share / least, trend.rows[k]))
    share, row = min(shares, default=(1.0, -1))
    return row if share < 1 else None


def _smallest(trends: Sequence[Trend], count: int) -> tuple[tuple[str, str, float], ...]:
    """Return the smallest change that is detected with 80 % power in the median pose if no other pose changes."""
    groups: dict[tuple[str, str], list[float]] = {}
    for trend in trends:
        distance = scipy.stats.t.isf(SETTINGS.false_discovery_rate / (2 * count), trend.freedom) + scipy.stats.t.ppf(
            SETTINGS.power, trend.freedom
        )
        groups.setdefault((trend.series.quantity, trend.label), []).append(
            float(distance * trend.error * np.ptp(trend.values))
        )
    return tuple((quantity, label, float(np.median(changes))) for (quantity, label), changes in sorted(groups.items()))
