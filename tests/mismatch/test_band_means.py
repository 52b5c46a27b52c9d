"""Means in bands against a loop over bands and lines."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from millfrf.mismatch.location.maps import band_means


@given(st.integers(1, 40), st.integers(1, 3), st.integers(1, 8), st.integers(0, 2**32 - 1))
def test_means_are_those_of_a_loop(lines: int, columns: int, bands: int, seed: int) -> None:
    """Frequencies and edges on a grid of quarters, so that lines lie on edges and bands are empty."""
    rng = np.random.default_rng(seed)
    frequencies = np.sort(rng.integers(4, 40, lines) / 4)
    edges = np.sort(rng.choice(np.arange(4, 44), bands + 1, replace=False) / 4)
    power = rng.exponential(size=(lines, columns))
    means, held = band_means(frequencies, power, edges)
    assert means.shape == (bands, columns)
    for band in range(bands):
        low = -np.inf if band == 0 else edges[band]
        high = np.inf if band == bands - 1 else edges[band + 1]
        inside = [k for k in range(lines) if low <= frequencies[k] < high]
        assert held[band] == len(inside)
        expected = sum(power[k] for k in inside) / len(inside) if inside else np.full(columns, np.nan)
        np.testing.assert_allclose(means[band], expected, rtol=1e-12)
    assert held.sum() == lines
