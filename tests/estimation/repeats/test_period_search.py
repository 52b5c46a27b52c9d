"""Periods are found where forces repeat, to a fraction of a sample, and nowhere else."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from estimation import find_repeats, repeat_of
from estimation.repeats.cut_periods import interpolated_periods
from estimation.repeats.period_search import Stretch

Real = NDArray[np.float64]


def rough(seed: int, period: float, n: int) -> Real:
    """Multisine up to 60 % of half the sample rate with any period, (n, 1)."""
    k = np.arange(int(0.02 * period / 2), int(0.6 * period / 2))
    phase = 2 * np.pi * np.random.default_rng(seed).random(len(k))
    angle = 2 * np.pi * np.outer(np.arange(n) / period, k) + phase
    return np.asarray(np.cos(angle).sum(axis=1, keepdims=True))


def noise(seed: int, shape: tuple[int, ...], size: float) -> Real:
    return size * np.random.default_rng(1000 + seed).normal(size=shape)


@pytest.mark.parametrize("period", [512.37, 1000.5, 777.01, 640.0])
def test_fractions_of_a_sample_are_found_within_their_error(period: float) -> None:
    force = rough(1, period, 8000)
    result = find_repeats(force + noise(1, force.shape, 0.05))
    assert result is not None
    assert abs(result.period - period) < max(4 * result.error, 1e-9)
    assert result.error < 1e-4
    assert result.period.is_integer() == float(period).is_integer()
    assert sum(each.n_periods for each in result.stretches) == 8000 // period


def test_successive_realisations_are_separated() -> None:
    force = np.concatenate([np.tile(rough(seed, 500, 500), (3, 1)) for seed in range(4)])
    result = find_repeats(force + noise(2, force.shape, 0.01))
    assert result is not None
    assert result.stretches == tuple(Stretch(1500 * k, 3) for k in range(4))


def test_silence_between_stretches_is_no_period() -> None:
    quiet = [np.zeros((n, 1)) for n in (700, 900, 50)]
    loud = [np.tile(rough(seed, 500, 500), (n, 1)) for seed, n in ((1, 3), (2, 5))]
    force = np.concatenate([quiet[0], loud[0], quiet[1], loud[1], quiet[2]])
    result = find_repeats(force + noise(3, force.shape, 0.01))
    assert result is not None
    assert result.stretches == (Stretch(700, 3), Stretch(3100, 5))


def test_a_nearly_repeating_lag_is_not_the_period() -> None:
    time = np.arange(40000)
    beat = (np.cos(2 * np.pi * time / 50) + np.cos(2 * np.pi * 101 * time / 5000))[:, None]
    result = find_repeats(beat)
    assert result is not None
    assert result.period == 5000


def test_random_forces_sweeps_and_silence_do_not_repeat() -> None:
    for seed in range(20):
        white = np.random.default_rng(seed).normal(size=(4000, 1))
        assert find_repeats(white) is None
        assert find_repeats(lfilter([1.0], [1.0, -1.99 * np.cos(0.1), 0.9901], white, axis=0)) is None
    time = np.arange(40000)
    assert find_repeats(np.cos(2 * np.pi * (0.01 * time + 1.25e-6 * time**2))[:, None]) is None
    assert find_repeats(np.zeros((1000, 1))) is None
    assert find_repeats(np.ones((30, 1))) is None


def test_the_first_lag_is_that_of_the_shortest_period() -> None:
    saw = np.tile(np.random.default_rng(0).normal(size=(300, 2)), (9, 1))
    assert repeat_of(saw, 50, 1000) == 300
    assert repeat_of(saw, 301, 1000) == 600
    assert repeat_of(saw, 900, 100) is None


def test_periods_interpolated_periods_are_the_signal_there() -> None:
    period, start = 512.37, 40.0
    signal = rough(4, period, 6000)
    cut = interpolated_periods(signal, start, period, 10)
    k = np.arange(int(0.02 * period / 2), int(0.6 * period / 2))
    phase = 2 * np.pi * np.random.default_rng(4).random(len(k))
    times = start + period * np.arange(512) / 512
    truth = np.cos(2 * np.pi * np.outer(times / period, k) + phase).sum(axis=1)
    assert np.abs(cut[:, :, 0] - truth).max() < 1e-3 * truth.std()


def test_slow_forces_have_no_period_of_less_than_a_sample() -> None:
    # a joint that follows a path: slow, smooth, and alike at every short lag
    for seed in range(20):
        rng = np.random.default_rng(seed)
        time = np.arange(1742) / 50.0
        force = np.interp(time, np.linspace(0, 35, 12), rng.normal(size=12))[:, None]
        result = find_repeats(force + 0.01 * np.sin(2 * np.pi * 0.1 * time)[:, None])
        assert result is None or result.period > 50
