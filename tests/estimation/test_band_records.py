"""Decimation keeps the band, keeps linear relations, and does not care about blocks."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimation import BandDecimator
from foundation import InputError


@given(cuts=st.lists(st.integers(0, 8000), max_size=5))
def test_blocks_do_not_matter(cuts: list[int]) -> None:
    samples = np.random.default_rng(0).standard_normal((8000, 2))
    whole = BandDecimator(2000.0, 40.0).add(samples)
    decimator = BandDecimator(2000.0, 40.0)
    parts = [decimator.add(part) for part in np.split(samples, sorted(cuts))]
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("frequency", [1.0, 20.0, 40.0])
def test_the_band_is_flat_and_in_phase_between_channels(frequency: float) -> None:
    time = np.arange(40_000) / 2000.0
    low = BandDecimator(2000.0, 40.0).add(
        np.column_stack([np.cos(2 * np.pi * frequency * time), np.sin(2 * np.pi * frequency * time)])
    )
    np.testing.assert_allclose(np.hypot(low[:, 0], low[:, 1]), 1.0, atol=2e-4)


def test_what_lies_above_does_not_come_down() -> None:
    decimator = BandDecimator(2000.0, 40.0)
    time = np.arange(40_000) / 2000.0
    alias = decimator.sample_rate - 20.0
    low = decimator.add(np.cos(2 * np.pi * alias * time)[:, None])
    assert np.abs(low).max() < 1e-4


def test_a_band_beyond_the_sample_rate_is_refused() -> None:
    with pytest.raises(InputError, match="does not fit a sample rate of 100 Hz"):
        BandDecimator(100.0, 45.0)
