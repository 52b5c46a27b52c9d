"""Forces are measured with noise too: what that does to a comparison, and that it is undone."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import firwin, lfilter

from estimation import BandRecording, WindowedSpectrum, channels_of, windowed_spectrum
from millfrf.mismatch import Hypothesis, LabError, ModelShape, diagnose, fit, predict_lines
from millfrf.mismatch.inference.settings import VerdictSettings
from millfrf.mismatch.records.bands import without_force_noise
from millfrf.mismatch.records.reading import band_of
from millfrf.mismatch.structure.structured_residual import remainder_of
from modal_fit import ModalModel

RATE, SILENT = 128.0, 26.0
FORCES = channels_of("force", ("TCP:+X", "TCP:+Y"), ("fx", "fy"))
MOTIONS = channels_of("acceleration", ("TCP:+X", "TCP:+Y"), ("ax", "ay"))
"""Hz; above ``SILENT`` nothing pushes."""


def _trial(model: ModalModel, level: float, seed: int) -> tuple[BandRecording, NDArray[np.float64]]:
    """Two forces that rise and fall together, silent above 26 Hz, 6 % noise on all signals; and that on forces."""
    rng = np.random.default_rng(seed)
    n = int(40 * RATE)
    common = lfilter(firwin(129, SILENT - 3, fs=RATE), 1.0, rng.normal(size=n))
    own = lfilter(firwin(129, SILENT - 3, fs=RATE), 1.0, rng.normal(size=(n, 2)), axis=0)
    force = level * (common[:, None] * [1.0, 0.4] + 0.005 * own)
    empty = BandRecording("t", RATE, force, np.zeros((n, 2)), FORCES, MOTIONS)
    lines = windowed_spectrum(empty, band_of(model, RATE), 1.0)
    shape = ModelShape(model, LabError())
    response = lines.signal(predict_lines(Hypothesis(shape, np.zeros(shape.size)), lines).spectrum)
    noise = 0.06 * force.std(axis=0) * rng.normal(size=force.shape)
    measured = response + 0.06 * response.std(axis=0) * rng.normal(size=response.shape)
    return BandRecording(f"level {level:g}", RATE, force + noise, measured, FORCES, MOTIONS), noise


@pytest.fixture(scope="module")
def lines(small_model: ModalModel) -> WindowedSpectrum:
    return windowed_spectrum(_trial(small_model, 40.0, 1)[0], band_of(small_model, RATE), 1.0)


def _spectrum(lines: WindowedSpectrum, force: NDArray[np.float64]) -> NDArray[np.complex128]:
    return lines.cut(force)


def test_what_is_only_noise_is_taken_for_nothing(small_model: ModalModel, lines: WindowedSpectrum) -> None:
    trial, noise = _trial(small_model, 40.0, 1)
    variance = noise.var(axis=0)
    weighed = without_force_noise(lines, variance)
    silent = lines.frequencies > SILENT + 2
    assert silent.sum() > 100
    left = np.mean(np.abs(weighed.force_here[silent]) ** 2, axis=0) / np.mean(np.abs(lines.force_here[silent]) ** 2)
    assert (left < 0.1).all()
    # where there is force, what is used is nearer to the true force than what was measured
    loud = lines.frequencies < SILENT - 8
    true = _spectrum(lines, trial.force - noise)[loud]
    error = np.mean(np.abs(weighed.force_here[loud] - true) ** 2, axis=0)
    assert (error < 0.8 * np.mean(np.abs(lines.force_here[loud] - true) ** 2, axis=0)).all()


def test_without_noise_forces_stay(lines: WindowedSpectrum) -> None:
    same = without_force_noise(lines, np.zeros(2))
    np.testing.assert_allclose(same.force_here, lines.force_here, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(same.force_lines, lines.force_lines, rtol=1e-6, atol=1e-6)


def test_noisy_forces_are_no_missing_mode(small_model: ModalModel) -> None:
    """Without it a mode near the silent band cancels the response that the noise seems to ask for."""
    trials = [_trial(small_model, level, seed)[0] for level, seed in ((20.0, 2), (40.0, 3), (80.0, 4))]
    result = diagnose(small_model, trials)
    assert result.verdict == "none", [(cause.name, cause.evidence) for cause in result.physics]


def test_a_recording_too_short_for_wide_means(small_model: ModalModel) -> None:
    trial = _trial(small_model, 40.0, 5)[0]
    short = replace(trial, force=trial.force[: 6 * int(RATE)], response=trial.response[: 6 * int(RATE)])
    prepared = windowed_spectrum(short, band_of(small_model, RATE), 2.0)
    assert np.isfinite(without_force_noise(prepared, np.ones(2)).force_here).all()


def test_a_force_that_is_silent_stays_so(small_model: ModalModel, lines: WindowedSpectrum) -> None:
    trial = lines.recording
    one_force = replace(trial, force=trial.force * [1.0, 0.0])
    prepared = windowed_spectrum(one_force, band_of(small_model, RATE), 1.0)
    weighed = without_force_noise(prepared, np.ones(2))
    assert np.isfinite(weighed.force_here).all()
    assert not weighed.force_here[:, 1].any()
    shape = ModelShape(small_model, LabError())
    assert np.isfinite(fit([prepared], Hypothesis(shape, np.zeros(shape.size))).score)


def test_a_smooth_spectrum_is_averaged_widely_and_a_harmonic_is_kept(lines: WindowedSpectrum) -> None:
    """Noise of two newtons a line with a harmonic: nearly nothing is left beside it, nearly all of it at its line."""
    trial, rng = lines.recording, np.random.default_rng(6)
    time = np.arange(len(trial.force)) / RATE
    harmonic = 20.0 * np.sin(2 * np.pi * 11.0 * time)
    noise = 2.0 * rng.normal(size=trial.force.shape)
    mixed = replace(lines, recording=replace(trial, force=harmonic[:, None] * [1.0, -0.6] + noise))
    weighed = without_force_noise(mixed.with_measured_forces(), np.full(2, 4.0))
    beside = np.abs(lines.frequencies - 11.0) > 1.0
    assert np.mean(np.abs(weighed.force_here[beside]) ** 2) < 0.03 * 4.0
    true, peak = lines.cut(harmonic[:, None] * [1.0, -0.6]), np.abs(lines.frequencies - 11.0) < 0.1
    assert np.abs(weighed.force_here - true)[peak].max() < 0.1 * np.abs(true[peak]).max()


def _swelling(model: ModalModel) -> WindowedSpectrum:
    """Forces with noise, which push the second mode for three seconds of two minutes; responses with hardly any."""
    rng = np.random.default_rng(7)
    n = int(120 * RATE)
    low, high = (
        lfilter(firwin(257, band, fs=RATE, pass_zero=False), 1.0, rng.normal(size=(n, 2)), axis=0)
        for band in ((2.0, 9.0), (11.0, 17.0))
    )
    force = 20.0 * low + 20.0 * high * (np.abs(np.arange(n) / RATE - 70.0) < 1.5)[:, None]
    trial = BandRecording("t", RATE, force, np.zeros((n, 2)), FORCES, MOTIONS)
    lines = windowed_spectrum(trial, band_of(model, RATE), 1.0)
    shape = ModelShape(model, LabError())
    response = lines.signal(predict_lines(Hypothesis(shape, np.zeros(shape.size)), lines).spectrum)
    measured = response + 0.005 * response.std(axis=0) * rng.normal(size=response.shape)
    noisy = replace(trial, force=force + rng.normal(size=force.shape), response=measured)
    return without_force_noise(windowed_spectrum(noisy, band_of(model, RATE), 1.0), np.ones(2))


def test_force_that_swells_from_little_leaves_nothing(small_model: ModalModel) -> None:
    """Taken for noise where it is weak on average, it would leave a residual that comes and goes with the signal.

    So it is with a loud swell; a faint one, which noise of the force outlasts in the same mode, still seems to.
    """
    lines = _swelling(small_model)
    shape = ModelShape(small_model, LabError())
    known = Hypothesis(shape, np.zeros(shape.size))
    only = windowed_spectrum(
        replace(lines.recording, force=lines.signal(lines.force_lines)), band_of(small_model, RATE), 1.0
    )
    noise_like = VerdictSettings().noise_like
    assert remainder_of(known, [only]).share > 10 * noise_like
    assert remainder_of(known, [lines]).share < noise_like
