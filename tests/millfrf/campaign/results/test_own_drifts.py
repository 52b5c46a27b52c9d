"""A pose that drifts as all do is told apart from one that drifts in a way of its own."""

from dataclasses import replace

import numpy as np
import pytest
from simulated_series import Simulated

from millfrf.campaign.results.drift import drifts_apart, find_drifts
from millfrf.campaign.results.settings import SETTINGS
from millfrf.campaign.results.trends import PooledTrend

MEAN = PooledTrend(1, 15.0, "frequency", "session", 11, -0.3, 0.15, 0.0, 3.0, 0.1)


@pytest.mark.parametrize(
    ("slope", "others", "between", "own"),
    [
        (-1.8, -0.3, 0.0, True),
        (-1.8, -1.6, 0.0, False),
        (-1.8, -0.3, 1.0, False),  # poses differ that much anyway
        (1.0, -1.0, 0.0, True),
    ],
)
def test_a_drift_is_of_its_own_by_its_distance_from_the_others(
    slope: float, others: float, between: float, own: bool
) -> None:
    made = Simulated(0)
    [trend, *_] = find_drifts(made.series(), made.labels("session")).all_trends
    trend = replace(trend, slope=slope, error=0.3)
    assert drifts_apart(trend, replace(MEAN, slope=others, between=between), 1) is own


def test_few_poses_tell_less_than_many() -> None:
    made = Simulated(0)
    [trend, *_] = find_drifts(made.series(), made.labels("session")).all_trends
    trend = replace(trend, slope=-1.6, error=0.3)
    assert drifts_apart(trend, MEAN, 1)
    assert not drifts_apart(trend, replace(MEAN, poses=3), 1)
    assert not drifts_apart(trend, MEAN, 100)


@pytest.mark.parametrize(("poses", "spread"), [(6, 0.0), (6, 0.5), (12, 0.5)])
def test_poses_that_drift_alike_but_for_scatter_are_rarely_called_their_own(poses: int, spread: float) -> None:
    """Slopes scatter by half between poses: in at most one campaign of twenty some pose is said to be different."""
    campaigns, alarms = 20, 0
    for seed in range(campaigns):
        made = Simulated(900 + seed, poses=poses)
        slopes = -3e-3 * (1 + spread * made.rng.normal(size=(poses, 2)))
        line = {(p, m): slopes[p, m - 1] * made.session for p in range(poses) for m in (1, 2)}
        drifts = find_drifts(made.series(line), made.labels("session")).drifts
        assert len(drifts) > poses
        alarms += any(each.own for each in drifts)
    assert alarms <= 3  # 5 % of 20 is 1; more than 3 has a probability of 1.6 %
    assert SETTINGS.own_drift_level == 0.05


def test_a_pose_that_drifts_more_than_all_others_is_found() -> None:
    result = 0
    for seed in range(10):
        made = Simulated(950 + seed, poses=12)
        slopes = np.full((12, 2), -1e-3)
        slopes[3, 1] -= 4e-3
        line = {(p, m): slopes[p, m - 1] * made.session for p in range(12) for m in (1, 2)}
        drifts = find_drifts(made.series(line), made.labels("session")).drifts
        result += [(each.trend.series.pose, each.trend.series.mode) for each in drifts if each.own] == [("P03", 2)]
    assert result >= 8


def test_with_nothing_to_compare_with_a_drift_is_not_said_to_be_its_own() -> None:
    made = Simulated(9, poses=1, sessions=5, repeats=2, modes=1)
    [drift] = find_drifts(made.series({(0, 1): 3e-3 * made.session}), made.labels("session")).drifts
    assert drift.others is None
    assert not drift.own
