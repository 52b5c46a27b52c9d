"""A windowed spectrum: white noise has its variance on each line, and a linear prediction leaves nothing over."""

from dataclasses import replace

import numpy as np
import pytest

from estimation import BandRecording, WindowedSpectrum, channels_of, windowed_spectrum

RATE = 200.0
FORCES, MOTIONS = channels_of("force", ["TCP:+X"]), channels_of("acceleration", ["TCP:+X"])
OMEGA, DAMPING, MASS = 2 * np.pi * 9.0, 0.05, 12.0


def receptance(frequencies: np.ndarray) -> np.ndarray:
    """One degree of freedom, (n, 1, 1), m/N."""
    omega = 2 * np.pi * frequencies
    return np.asarray(1 / (MASS * (OMEGA**2 - omega**2 + 2j * DAMPING * OMEGA * omega)))[:, None, None]


@pytest.fixture(scope="module")
def driven() -> WindowedSpectrum:
    """White forces, and the accelerations of the oscillator under them, at rest before; no noise."""
    rng, n = np.random.default_rng(0), 8000
    force = np.zeros((n, 1))
    force[200:] = rng.normal(size=(n - 200, 1))
    padded = 4 * n
    axis = np.fft.rfftfreq(padded, 1 / RATE)
    spectrum = np.einsum("kpq,kq->kp", receptance(axis), np.fft.rfft(force, n=padded, axis=0))
    spectrum *= -((2 * np.pi * axis[:, None]) ** 2)
    response = np.fft.irfft(spectrum, n=padded, axis=0)[:n]
    return windowed_spectrum(BandRecording("t", RATE, force, response, FORCES, MOTIONS), (2.0, 40.0), DAMPING * OMEGA)


def test_white_noise_has_its_variance_on_each_line() -> None:
    rng, deviation = np.random.default_rng(1), 3.0
    noise = deviation * rng.normal(size=(40_000, 1))
    result = windowed_spectrum(BandRecording("t", RATE, noise, noise, FORCES, MOTIONS), (1.0, 90.0), 2.0)
    power = np.abs(result.measured[:, 0]) ** 2
    assert len(power) > 10_000
    assert power.mean() == pytest.approx(deviation**2, rel=0.05)  # 5 standard deviations of the mean


def test_a_linear_prediction_leaves_nothing_over(driven: WindowedSpectrum) -> None:
    """Forces through the true receptance: prediction and measurement leak alike."""
    predicted = driven.from_force(receptance(driven.padded_frequencies), driven.force_lines)
    rest = np.linalg.norm(driven.measured - predicted) / np.linalg.norm(driven.measured)
    assert rest < 2e-3
    plain = receptance(driven.frequencies)[:, :, 0] * driven.force_here * driven.kinematic
    leaked = np.linalg.norm(driven.measured - plain) / np.linalg.norm(driven.measured)
    assert leaked > 5 * rest


def test_lines_lie_in_the_band(driven: WindowedSpectrum) -> None:
    assert driven.frequencies[0] >= 2.0
    assert driven.frequencies[-1] <= 40.0
    np.testing.assert_allclose(np.diff(driven.frequencies), RATE / len(driven.window), rtol=1e-9)
    assert np.sum(driven.window**2) == pytest.approx(1.0)


def test_cutting_a_signal_is_how_the_response_was_cut(driven: WindowedSpectrum) -> None:
    np.testing.assert_array_equal(driven.cut(driven.recording.response), driven.measured)
    np.testing.assert_array_equal(driven.cut(driven.recording.force), driven.force_here)


def test_thinned(driven: WindowedSpectrum) -> None:
    few = driven.thinned(100)
    assert 100 <= len(few.frequencies) < 200
    every = len(driven.frequencies) // 100
    np.testing.assert_array_equal(few.measured, driven.measured[::every])
    assert driven.thinned(len(driven.frequencies)) is driven


def test_measured_forces_come_back(driven: WindowedSpectrum) -> None:
    altered = replace(driven, force_lines=0 * driven.force_lines, trust=0 * driven.trust)
    back = altered.with_measured_forces()
    np.testing.assert_array_equal(back.force_lines, driven.force_lines)
    np.testing.assert_array_equal(back.trust, driven.trust)
