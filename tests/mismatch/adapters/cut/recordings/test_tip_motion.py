"""Motion of the tip, integrated from samples whose integrals are known."""

import numpy as np
import pytest

from millfrf.mismatch.cut.motion import TipMotion, corner_of, integrated, integrated_noise


def test_acceleration_is_integrated_to_displacement_and_velocity() -> None:
    times = np.arange(20000) / 2000.0
    wave = 2 * np.pi * 19.3
    acceleration = -(wave**2) * 1e-5 * np.sin(wave * times)[:, None]
    noisy = acceleration + 0.02 * acceleration.std() * np.random.default_rng(1).standard_normal(acceleration.shape)
    moved, speed = integrated(noisy, 2, 2000.0, 1.5)
    kept = slice(2000, 18000)
    np.testing.assert_allclose(moved[kept, 0], 1e-5 * np.sin(wave * times)[kept], atol=3e-7)
    np.testing.assert_allclose(speed[kept, 0], wave * 1e-5 * np.cos(wave * times)[kept], atol=3e-5)


def test_displacement_and_velocity_are_taken_as_they_are() -> None:
    times = np.arange(20000) / 2000.0
    wave = 2 * np.pi * 19.3
    for power in (0, 1):
        moved, speed = integrated(1e-5 * wave**power * np.sin(wave * times)[:, None], power, 2000.0, 1.5)
        kept = slice(2000, 18000)
        amplitudes = [np.sqrt(2) * float(each[kept, 0].std()) for each in (moved, speed)]
        assert amplitudes == pytest.approx([1e-5, 1e-5 * wave], rel=0.01)


def test_a_draw_of_the_noise_is_as_strong_as_the_noise() -> None:
    """White noise of displacement: the draw has its deviation, where the corner leaves it."""
    noise = 1e-6 * np.random.default_rng(2).standard_normal((20000, 1))
    wave = 1e-4 * np.sin(2 * np.pi * 19.3 * np.arange(20000) / 2000.0)[:, None]
    drawn, _ = integrated_noise(wave + noise, 0, 2000.0, 1.5, 5)
    assert 0.0 < float(drawn.std()) < 1.2e-6


def test_noise_is_added_once_more_where_it_is_known() -> None:
    still = np.zeros((4, 3))
    known = TipMotion(still, still, "measured", np.stack([still + 1, still + 2]))
    assert (known.noisier().displacement == 1).all()
    assert (known.noisier().velocity == 2).all()
    silent = TipMotion(still, still, "model")
    assert silent.noisier() is silent


def test_the_corner_is_a_tenth_of_the_spindle_and_two_hertz_at_most() -> None:
    assert corner_of(12.0) == pytest.approx(1.2)
    assert corner_of(100.0) == 2.0
