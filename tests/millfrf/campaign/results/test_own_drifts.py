"""A pose that drifts as all do is told apart from one that drifts in a way of its own."""

from types import SimpleNamespace
from typing import Any

import pytest

from millfrf.campaign.results.drift.judged import Drift


def _drift(slope: float, others: float | None, between: float = 0.0) -> Drift:
    trend: Any = SimpleNamespace(slope=slope, error=0.3)
    mean: Any = None if others is None else SimpleNamespace(slope=others, error=0.15, between=between)
    return Drift(trend, 0.001, mean, (), None)


@pytest.mark.parametrize(
    ("slope", "others", "between", "own"),
    [
        (-1.8, -0.3, 0.0, True),
        (-1.8, -1.6, 0.0, False),
        (-1.8, -0.3, 1.0, False),  # poses differ that much anyway
        (1.0, -1.0, 0.0, True),
        (-0.5, None, 0.0, True),  # nothing to compare with
    ],
)
def test_a_drift_is_of_its_own_by_its_distance_from_the_others(
    slope: float, others: float | None, between: float, own: bool
) -> None:
    assert _drift(slope, others, between).own is own
