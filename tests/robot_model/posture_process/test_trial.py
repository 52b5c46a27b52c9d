"""The trial in small: bands hold, and the process about the model beats what is simpler. The large one is slow."""

import pytest
from trial import compared, trial


@pytest.mark.long
def test_bands_hold_and_errors_are_smaller_than_those_of_simpler_ways() -> None:
    result = trial(range(40, 42), postures=8, new=4, depths=False)
    for quantity in ("frequency", "damping"):
        learned = compared(result, "learned", quantity)
        # 48 bands at 95 %, dependent within a cell: fewer than 40 would be far from it
        assert learned.coverage >= 40 / 48
        for way in ("updated", "nearest", "plain"):
            assert learned.error < compared(result, way, quantity).error


@pytest.mark.slow
def test_coverage_over_many_cells_lies_between_90_and_99_percent() -> None:
    result = trial(range(100, 124), postures=12, new=6)
    for quantity in ("frequency", "damping", "depth"):
        assert 0.9 <= compared(result, "learned", quantity).coverage <= 0.99, quantity
