"""Ranks of limits found by counting unstable structures are those of limits that are computed one by one."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_cuts import random_case

from millfrf.stability import lowest_limits, ranked_depths
from millfrf.stability.drawn_structures import drawn
from millfrf.stability.ranked_limits import ranked_limits, steps_around


def test_every_rank_is_that_of_the_limits_computed_one_by_one() -> None:
    for seed in range(3):
        case = random_case(seed)
        draws = drawn(case.model, case.cut, 9, seed)
        speeds = case.speeds[[len(case.speeds) // 3, len(case.speeds) // 2]]
        computed = np.sort([lowest_limits(*draw, speeds, case.max_depth).lowest().depth_limits.min() for draw in draws])
        limits = ranked_limits(draws, speeds, steps_around(float(computed[4]), case.max_depth))
        for rank, limit in enumerate(computed, start=1):
            low, high = limits.ranked(rank)
            assert low <= limit * (1 + 1e-6)
            assert limit * (1 - 1e-6) <= high
            assert high == np.inf or high - low <= 1e-3 * high


def test_a_rank_above_the_largest_depth_is_infinite() -> None:
    case = random_case(0)
    draws = drawn(case.model, case.cut, 5, 0)
    speeds = case.speeds[[len(case.speeds) // 2]]
    lowest = min(float(lowest_limits(*draw, speeds, case.max_depth).lowest().depth_limits[0]) for draw in draws)
    limits = ranked_limits(draws, speeds, steps_around(np.inf, 0.5 * lowest))
    assert limits.ranked(1) == limits.ranked(5) == (np.inf, np.inf)


def test_errors_of_the_coefficients_scale_the_limits_of_one_structure() -> None:
    """The limit is inversely proportional to the tangential coefficient if the others are ratios of it."""
    case = random_case(0)
    cut = replace(case.cut, ktc_std=0.1 * case.cut.ktc, krc_std=0.0, kac_std=0.0)
    speeds = case.speeds[[len(case.speeds) // 2]]
    limit = float(lowest_limits(case.model, cut, speeds, case.max_depth).lowest().depth_limits[0])
    exact = replace(case.model, covariance=None)
    coefficients = np.sort([each.ktc for _, each in drawn(exact, cut, 39, 0)])[::-1]
    result = ranked_depths([exact] * 39, cut, speeds, limit, 3 * limit, (1, 20, 39))
    assert result == pytest.approx(limit * cut.ktc / coefficients[[0, 19, 38]], rel=2e-3)


def test_depths_end_at_the_largest_one() -> None:
    case = random_case(0)
    speeds = case.speeds[[len(case.speeds) // 2]]
    limit = float(lowest_limits(case.model, case.cut, speeds, case.max_depth).lowest().depth_limits[0])
    result = ranked_depths([case.model] * 3, case.cut, speeds, limit, 0.5 * limit, (1, 3))
    assert result.tolist() == [0.5 * limit] * 2
