"""Resampling keeps the band, keeps linear relations, and does not care about blocks."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.signal import lfilter

from estimation import Resampler, needed_ratio, resampled, whole_ratio
from millfrf.core import InputError

RATIOS = [Fraction(1, 20), Fraction(3, 20), Fraction(2, 5), Fraction(19, 200)]


@given(cuts=st.lists(st.integers(0, 8000), max_size=5), ratio=st.sampled_from(RATIOS))
def test_blocks_do_not_matter(cuts: list[int], ratio: Fraction) -> None:
    samples = np.random.default_rng(0).standard_normal((8000, 2))
    whole = Resampler(2000.0, ratio).add(samples)
    resampler = Resampler(2000.0, ratio)
    parts = [resampler.add(part) for part in np.split(samples, sorted(cuts))]
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("ratio", [*RATIOS, Fraction(1)])
@pytest.mark.parametrize("share", [0.01, 0.2, 0.4])
def test_a_sine_is_the_same_sine_at_the_times_it_states(ratio: Fraction, share: float) -> None:
    """Up to 0.4 of the new rate: amplitude, phase and the time of the first sample."""
    resampler = Resampler(2000.0, ratio)
    turn = 2 * np.pi * share * resampler.rate
    low = resampler.add(np.sin(turn * np.arange(40_000) / 2000.0)[:, None])[:, 0]
    times = resampler.start + np.arange(len(low)) / resampler.rate
    np.testing.assert_allclose(low, np.sin(turn * times), atol=1e-4)


@pytest.mark.parametrize("ratio", RATIOS)
def test_what_lies_above_does_not_come_down(ratio: Fraction) -> None:
    resampler = Resampler(2000.0, ratio)
    time = np.arange(40_000) / 2000.0
    alias = 0.6 * resampler.rate
    low = resampler.add(np.cos(2 * np.pi * alias * time)[:, None])
    assert np.abs(low).max() < 1e-4


@pytest.mark.parametrize("ratio", RATIOS)
def test_no_sample_leans_on_data_outside_the_record(ratio: Fraction) -> None:
    """A constant stays one from the first sample to the last."""
    low, _ = resampled(np.full((5000, 1), 3.0), 2000.0, ratio)
    assert len(low) > 100
    np.testing.assert_allclose(low, 3.0, atol=1e-3)


def test_linear_relations_hold_afterwards() -> None:
    """A sample-wise gain and a delay by whole new samples, between two columns, hold for the resampled ones."""
    noise = np.random.default_rng(1).standard_normal(20_000)
    late = lfilter([0.0] * 40 + [0.5], [1.0], noise)
    low, rate = resampled(np.column_stack([noise, late])[40:], 2000.0, Fraction(1, 20))
    assert rate == 100.0
    np.testing.assert_allclose(low[2:, 1], 0.5 * low[:-2, 0], atol=1e-12)


def test_ratios() -> None:
    assert whole_ratio(2000.0, 40.0) == Fraction(1, 20)
    assert whole_ratio(100.0, 30.0) == 1
    assert needed_ratio(2000.0, 1400.0) == 1
    assert needed_ratio(2000.0, 600.0) == Fraction(3, 10)
    assert needed_ratio(2000.0, 1.0) == Fraction(1, 200)
    for rate in np.random.default_rng(2).uniform(1.0, 20.0, 50):
        assert float(needed_ratio(100 * rate, 60.0)) * 100 * rate == pytest.approx(60.0, rel=0.05) or rate < 0.9


def test_a_band_beyond_the_sample_rate_is_refused() -> None:
    with pytest.raises(InputError, match="does not fit a sample rate of 100 Hz"):
        whole_ratio(100.0, 45.0)


def test_samples_are_not_brought_up() -> None:
    with pytest.raises(InputError, match="ratio 2 is not between 0 and 1"):
        Resampler(100.0, Fraction(2))
