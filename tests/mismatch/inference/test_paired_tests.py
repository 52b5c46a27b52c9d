"""Paired tests against enumeration, and against the coverage that they promise."""

from itertools import product

import numpy as np
import pytest
from scipy.special import stdtr

from millfrf.mismatch.inference.numerics import ratio_interval, signed_ranks, students_test


def test_signed_ranks_agree_with_the_enumeration_of_all_signs() -> None:
    """Under the null hypothesis every choice of signs of the falls is as likely."""
    rng = np.random.default_rng(2)
    for _ in range(10):
        fall = rng.standard_normal(8) + 0.5
        ranks = np.argsort(np.argsort(np.abs(fall))) + 1
        seen = ranks[fall > 0].sum()
        sums = [
            sum(rank for rank, each in zip(ranks, signs, strict=True) if each) for signs in product((0, 1), repeat=8)
        ]
        expected = np.mean(np.array(sums) >= seen)
        assert signed_ranks(10 + fall, np.full(8, 10.0)) == pytest.approx(expected, rel=1e-9)


def test_students_test_is_the_tail_of_students_law() -> None:
    rng = np.random.default_rng(5)
    before, after = rng.uniform(1, 2, 7), rng.uniform(0.5, 1.5, 7)
    fall = before - after
    statistic = fall.mean() / (fall.std(ddof=1) / np.sqrt(7))
    assert students_test(before, after) == pytest.approx(stdtr(6, -statistic), rel=1e-9)


@pytest.mark.parametrize("test", [signed_ranks, students_test])
def test_no_change_is_no_evidence(test: object) -> None:
    assert callable(test)
    assert test(np.ones(6), np.ones(6)) == 1.0


@pytest.mark.long
@pytest.mark.parametrize("test", [signed_ranks, students_test])
def test_a_false_alarm_is_as_rare_as_its_p_value_says(test: object) -> None:
    assert callable(test)
    rng = np.random.default_rng(11)
    p_values = [test(*rng.chisquare(50, (2, 16))) for _ in range(2000)]
    for level in (0.05, 0.2):
        assert np.mean(np.array(p_values) < level) == pytest.approx(level, abs=4 * np.sqrt(level / 2000))


def test_the_interval_of_a_ratio_covers_the_truth() -> None:
    """Blocks of chi-square power: 95 % intervals of ``sqrt(after / before)`` hold the truth in 90 to 98 %."""
    rng, inside = np.random.default_rng(4), []
    for _ in range(300):
        before, after = rng.chisquare(20, 40), 0.25 * rng.chisquare(20, 40)
        low, high = ratio_interval(before, after)
        inside.append(low < 0.5 < high)
    assert 0.90 <= np.mean(inside) <= 0.98


def test_equal_blocks_have_an_interval_without_width() -> None:
    assert ratio_interval(np.full(9, 4.0), np.full(9, 1.0)) == pytest.approx((0.5, 0.5))
