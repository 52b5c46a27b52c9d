"""Hammer taps, windows and unusable samples on signals whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acquisition import Channel
from estimation import SpectralAccumulator, SpectralSettings, exponential_window, find_taps, force_window
from estimation.spectra.trusted_samples import usable_samples
from millfrf.core import InputError

RATE = 10_240.0
FORCE = Channel("fx", "force", "N", "TCP", "+X", full_scale=100.0)
MOTION = Channel("ux", "displacement", "m", "TCP", "+X")


def tap(time: np.ndarray, at: float, peak: float, contact: float = 1.5e-3) -> np.ndarray:
    """Half-sine pulse that peaks at ``at``."""
    phase = (time - at) / contact + 0.5
    return np.where((phase > 0) & (phase < 1), peak * np.sin(np.pi * np.clip(phase, 0, 1)), 0.0)


def test_a_double_hit_3_ms_later_at_a_fifth_of_the_height_is_found() -> None:
    time = np.arange(int(4 * RATE)) / RATE
    force = tap(time, 0.5, 400) + tap(time, 1.5, 300) + tap(time, 1.503, 60) + tap(time, 3.0, 350)
    force += np.random.default_rng(0).standard_normal(len(time))
    taps = find_taps(force, RATE)
    assert [round(result.time, 2) for result in taps] == [0.5, 1.5, 3.0]
    assert [result.second_hit is None for result in taps] == [True, False, True]
    assert taps[1].second_hit == pytest.approx(3e-3, abs=2e-4)
    assert taps[1].second_share == pytest.approx(0.2, abs=0.02)


@given(
    delay=st.floats(3e-3, 0.1), share=st.floats(0.15, 0.9), peak=st.floats(50, 1000), sign=st.sampled_from([-1.0, 1.0])
)
def test_double_hits_of_any_strength_and_sign(delay: float, share: float, peak: float, sign: float) -> None:
    time = np.arange(int(RATE)) / RATE
    single = sign * tap(time, 0.3, peak)
    assert [result.second_hit for result in find_taps(single, RATE)] == [None]
    [result] = find_taps(single + sign * tap(time, 0.3 + delay, share * peak), RATE)
    assert result.second_hit == pytest.approx(delay, abs=2e-4)


def test_silent_hammer_is_refused() -> None:
    with pytest.raises(InputError, match="constant"):
        find_taps(np.zeros(1000), RATE)


def test_damping_of_the_exponential_window_comes_off_the_poles() -> None:
    """A decay that the window shortens: its fitted pole, corrected, is the true one."""
    pole = 2 * np.pi * 20 * (-0.01 + 1j)
    n, tau = 20_480, 0.4
    decay = np.exp(pole * np.arange(n) / RATE) * exponential_window(n, RATE, tau)
    fitted = np.log(decay[1:] / decay[:-1]).mean() * RATE
    assert fitted + 1 / tau == pytest.approx(pole, rel=1e-9)
    window = force_window(n, RATE, 0.01)
    assert window[: int(0.01 * RATE)].min() == 1.0
    assert window[int(0.0126 * RATE) + 1 :].max() == pytest.approx(0.0, abs=1e-12)


def test_overload_clipping_and_dropped_buffers_are_found() -> None:
    rng = np.random.default_rng(1)
    clean = np.column_stack([20 * rng.standard_normal(5000), 1e-6 * rng.standard_normal(5000)])
    assert usable_samples(clean, (FORCE, MOTION)).all()
    damaged = clean.copy()
    damaged[100, 0] = 100.0  # overload
    damaged[1000:1008, 1] = 1e-5  # clipped at a level below the full scale
    damaged[2000:2016] = damaged[1999]  # a buffer handed out again
    damaged[3000, 0] = np.nan
    bad = np.flatnonzero(~usable_samples(damaged, (FORCE, MOTION)))
    assert set(bad) == {100, *range(1000, 1008), *range(2000, 2016), 3000}


def test_segments_with_bad_samples_do_not_count() -> None:
    rng = np.random.default_rng(2)
    force, motion = rng.standard_normal((2, 4096, 1))
    settings = SpectralSettings(512, 0.5, "hann")
    damaged = force.copy()
    damaged[1000:1010] = 1e6
    usable = np.ones(4096, dtype=bool)
    usable[1000:1010] = False
    outcome = SpectralAccumulator((FORCE,), (MOTION,), RATE, settings)
    for part in (slice(0, 1005), slice(1005, 1700), slice(1700, None)):  # blocks cut through the bad place
        outcome.add(damaged[part], motion[part], usable[part])
    result = outcome.result()
    # segments that start at 512 and 768 hold the bad samples
    expected = SpectralAccumulator((FORCE,), (MOTION,), RATE, replace(settings, overlap=0.0))
    for start in range(0, 4096 - 511, 256):
        if start not in (512, 768):
            expected.add(force[start : start + 512], motion[start : start + 512])
    assert (result.n_segments, result.n_excluded) == (13, 2)
    np.testing.assert_allclose(result.input_spectra, expected.result().input_spectra, rtol=1e-10)
    none = SpectralAccumulator((FORCE,), (MOTION,), RATE, settings)
    none.add(force, motion, np.zeros(4096, dtype=bool))
    with pytest.raises(InputError, match="all 15 segments"):
        none.result()
