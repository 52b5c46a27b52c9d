"""Spectra of forces in blocks, against white noise and a sine."""

import numpy as np
import pytest

from millfrf.mismatch.cut.motion import SpindleLaw
from millfrf.mismatch.cut.recordings import CutRecording, ForceSpectra, force_spectra

RATE, LAW = 2000.0, SpindleLaw(5.0, 0.0, 84.0)


def _spectra(force: np.ndarray) -> ForceSpectra:
    return force_spectra(CutRecording("r", RATE, force, (0, 1, 2), None, LAW, 0.1), 2)


def test_white_noise_has_its_variance_in_every_line() -> None:
    result = _spectra(3.0 * np.random.default_rng(1).standard_normal((20000, 3)))
    power = np.abs(result.measured) ** 2
    assert power.mean() == pytest.approx(9.0, rel=0.1)
    assert result.measured.shape == (result.blocks, len(result.frequencies), 3)


def test_a_sine_stands_at_its_frequency() -> None:
    force = np.zeros((20000, 3))
    force[:, 1] = np.sin(2 * np.pi * 71.0 * np.arange(20000) / RATE)
    result = _spectra(force)
    power = np.abs(result.measured).sum(axis=0)
    assert abs(result.frequencies[int(np.argmax(power[:, 1]))] - 71.0) <= RATE / result.size
    assert power[:, [0, 2]].max() < 1e-9


def test_a_finer_force_has_the_same_spectra() -> None:
    """Below both Nyquist frequencies nothing depends on how finely a smooth force is computed."""
    times = np.arange(80000) / (4 * RATE)
    force = np.sin(2 * np.pi * 71.0 * times)[:, None] * np.ones(3)
    result = _spectra(force[::4])
    np.testing.assert_allclose(result.of(force, 4), result.measured, atol=2e-3 * np.abs(result.measured).max())


def test_lines_reach_the_eighth_harmonic_of_the_tooth_passing() -> None:
    result = _spectra(np.zeros((20000, 3)))
    tooth = 2 * LAW.speed / (2 * np.pi)
    assert 8 * tooth < result.frequencies[-1] <= 8.5 * tooth
    assert result.first == 200
    assert 4 <= result.blocks <= 16
