"""Anti-alias filter, high-pass, noise, range and steps of the simulated laboratory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from millfrf.core import InputError
from replay_data import Sensor
from replay_data.laboratory import Decimator, SignalChain, anti_alias_filter

RATE = 10240.0


def sensor(**changes: object) -> Sensor:
    return Sensor(**({"name": "fx", "quantity": "force", "degree_of_freedom": "TCP:+X"} | changes))  # type: ignore[arg-type]


@given(st.lists(st.integers(1, 300), min_size=1, max_size=6), st.sampled_from([1, 2, 4]))
def test_decimation_does_not_depend_on_the_blocks(lengths: list[int], factor: int) -> None:
    samples = np.random.default_rng(1).standard_normal((sum(lengths), 2))
    whole = Decimator(factor, 2)(samples)
    decimator = Decimator(factor, 2)
    parts = [decimator(part) for part in np.split(samples, np.cumsum(lengths)[:-1])]
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=0, atol=1e-14)


@pytest.mark.parametrize("factor", [2, 4])
def test_decimation_keeps_the_time_of_slow_signals_and_stops_what_would_alias(factor: int) -> None:
    times = np.arange(8192 * factor) / (RATE * factor)
    slow = np.sin(2 * np.pi * 170.0 * times + 0.3)
    fast = np.sin(2 * np.pi * (RATE - 170.0) * times)
    output = Decimator(factor, 2)(np.column_stack([slow, fast]))[100:]
    expected = np.sin(2 * np.pi * 170.0 * (100 + np.arange(len(output))) / RATE + 0.3)
    np.testing.assert_allclose(output[:, 0], expected, atol=2e-4)
    assert np.abs(output[:, 1]).max() < 2e-4


def test_the_filter_passes_the_lower_half_of_the_band_and_stops_above() -> None:
    taps = anti_alias_filter(4)
    frequencies = np.linspace(0, 2 * RATE, 4001)
    gain = np.abs(np.exp(-2j * np.pi * np.outer(frequencies / (4 * RATE), np.arange(len(taps)))) @ taps)
    assert gain[0] == pytest.approx(1, abs=1e-12)
    assert np.abs(gain[frequencies < 0.22 * RATE] - 1).max() < 1e-3
    assert gain[frequencies > 0.6 * RATE].max() < 1e-3


@pytest.mark.parametrize("frequency", [0.5, 17.0, 200.0])
def test_the_high_pass_is_that_of_first_order(frequency: float) -> None:
    """Steady sine: gain and phase of ``i f / (i f + corner)``; the bilinear transform is off by (pi f / rate)^2 / 3."""
    corner, n_samples = 0.1, int(40 * RATE)
    times = np.arange(n_samples) / RATE
    chain = SignalChain([sensor(high_pass_hz=corner, bits=52)], RATE, np.zeros(1), 0)
    output = chain(np.cos(2 * np.pi * frequency * times)[:, None])[:, 0]
    tail = slice(n_samples - int(20 * RATE), n_samples)
    measured = 2 * np.mean(output[tail] * np.exp(-2j * np.pi * frequency * times[tail]))
    assert abs(measured - 1j * frequency / (1j * frequency + corner)) < 2e-5


def test_the_high_pass_continues_over_blocks() -> None:
    samples = np.random.default_rng(3).standard_normal((900, 2))
    sensors = [sensor(high_pass_hz=5.0), sensor(high_pass_hz=None)]
    whole = SignalChain(sensors, RATE, np.zeros(2), 0)(samples)
    chain = SignalChain(sensors, RATE, np.zeros(2), 0)
    np.testing.assert_array_equal(np.concatenate([chain(samples[:123]), chain(samples[123:])]), whole)


@given(st.floats(1e-3, 1e4), st.sampled_from([8, 16, 24]), st.integers(0, 50))
def test_what_is_written_is_a_whole_number_of_steps_within_range(full_scale: float, bits: int, seed: int) -> None:
    device = sensor(full_scale=full_scale, bits=bits)
    physical = np.random.default_rng(seed).uniform(-1.5, 1.5, (200, 1)) * full_scale
    written = SignalChain([device], RATE, np.zeros(1), 0)(physical)
    steps = written / device.resolution
    assert np.abs(steps - np.rint(steps)).max() < 1e-6
    assert np.abs(written).max() <= full_scale
    inside = np.abs(physical) < full_scale
    assert np.abs(written - physical)[inside].max() <= 0.5 * device.resolution * (1 + 1e-9)
    np.testing.assert_array_equal(written[~inside], np.sign(physical[~inside]) * full_scale)


def test_noise_has_its_size_is_white_and_repeats_by_seed() -> None:
    size = np.array([2.0, 0.5])
    chains = [SignalChain([sensor(), sensor()], RATE, size, seed) for seed in (7, 7, 8)]
    first, again, other = (chain(np.zeros((200_000, 2))) for chain in chains)
    np.testing.assert_array_equal(first, again)
    assert np.abs(first - other).max() > 1
    np.testing.assert_allclose(first.std(axis=0), size, rtol=0.01)  # 6 sigma of a standard deviation of 2e5 samples
    lag_one = np.mean(first[1:] * first[:-1], axis=0) / size**2
    assert np.abs(lag_one).max() < 5 / np.sqrt(200_000)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"noise": -0.1}, "noise -0.1 must be zero or more"),
        ({"full_scale": 0.0}, "full scale 0.0 must be positive"),
        ({"bits": 1}, "1 bits; a converter has 2 to 52"),
        ({"high_pass_hz": 0.0}, "high-pass 0.0 Hz must be positive"),
        ({"degree_of_freedom": "TCP"}, "not understood"),
    ],
)
def test_impossible_sensors_are_refused(changes: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        sensor(**changes)
