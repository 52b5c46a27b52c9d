"""Clock pairs tell a wrong rate and lost samples, and take a busy computer for neither."""

import numpy as np
import pytest

from acquisition import check_clock

RATE = 10_240.0


def pairs(
    seconds: float,
    seed: int,
    *,
    true_rate: float = RATE,
    gaps: tuple[tuple[float, float], ...] = (),
    stalls: float = 0.02,
) -> np.ndarray:
    """Blocks of a tenth of a second; the host is late by some milliseconds, and for a second now and then."""
    generator = np.random.default_rng(seed)
    counts = np.arange(1, int(10 * seconds) + 1) * round(0.1 * RATE)
    times = counts / true_rate + generator.exponential(0.002, len(counts))
    for at, length in gaps:
        times[counts / RATE > at] += length
    for k in np.flatnonzero(generator.random(len(counts)) < stalls):
        until = times[k] + generator.exponential(1.0)
        waits = (times >= times[k]) & (times < until)
        times[waits] = until
    return np.column_stack([counts, 5000.0 + times])


@pytest.mark.parametrize("seconds", [10.0, 60.0, 600.0])
def test_a_busy_computer_is_no_fault_of_the_recording(seconds: float) -> None:
    result = [check_clock(pairs(seconds, seed, true_rate=RATE * (1 + 3e-4)), RATE) for seed in range(40)]
    assert sum(bool(each.gaps) for each in result) <= 1
    assert not any(each.rate_is_wrong for each in result)


def test_blocks_of_two_seconds_that_were_dropped_are_a_gap() -> None:
    for seed in range(20):
        result = check_clock(pairs(60.0, seed, gaps=((20.0, 2.0),), stalls=0.0), RATE)
        (gap,) = result.gaps
        assert gap.seconds == pytest.approx(2.0, abs=0.01)
        assert gap.after_sample == pytest.approx(20.0 * RATE, abs=1100)
        assert not result.rate_is_wrong


def test_several_gaps_are_found_among_stalls() -> None:
    """A stall may hide the moment of a gap, and seldom the gap itself."""
    result = [check_clock(pairs(60.0, seed, gaps=((20.0, 0.5), (40.0, 0.1))), RATE) for seed in range(40)]
    assert sum(len(each.gaps) == 2 for each in result) >= 32
    assert not any(each.rate_is_wrong for each in result)


@pytest.mark.parametrize("true_rate", [9216.0, RATE * 1.003, 2 * RATE])
def test_a_wrong_rate_is_told_with_the_right_one(true_rate: float) -> None:
    for seed in range(20):
        result = check_clock(pairs(60.0, seed, true_rate=true_rate, stalls=0.0), RATE)
        assert result.rate_is_wrong
        assert result.true_rate == pytest.approx(true_rate, rel=1e-3)


@pytest.mark.parametrize("seconds", [0.8, 1.0, 2.0, 5.0])
def test_a_short_recording_with_a_right_rate_is_not_refused(seconds: float) -> None:
    """A hammer test lasts some seconds: few pairs, late by milliseconds, must not make its rate wrong."""
    for seed in range(60):
        for stalls in (0.0, 0.02):
            result = check_clock(pairs(seconds, seed, true_rate=RATE * (1 + 3e-4), stalls=stalls), RATE)
            assert not result.rate_is_wrong


def test_a_rate_that_is_off_by_a_tenth_is_told_after_a_second() -> None:
    result = [check_clock(pairs(1.0, seed, true_rate=9216.0, stalls=0.0), RATE).rate_is_wrong for seed in range(40)]
    assert all(result)


def test_too_few_pairs_tell_nothing() -> None:
    result = check_clock(pairs(0.5, 0), RATE)
    assert np.isnan(result.true_rate)
    assert (result.rate_is_wrong, result.gaps) == (False, ())
