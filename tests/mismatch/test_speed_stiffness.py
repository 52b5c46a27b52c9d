"""A stiffness that follows the spindle speed, which sweeps up or down: told from one that changes with time."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from concealed_recordings import FORCES, LABELS, MOTIONS, RATE
from numpy.typing import NDArray

from estimation import BandRecording, swept_line
from millfrf.mismatch import StructureDiagnosis, diagnose
from modal_fit import ModalModel

Real = NDArray[np.float64]
SHAPES = np.array([[1.0, 0.35], [-0.4, 1.0]])  # a row for each mode
MASSES, OMEGA, DAMPING = np.array([40.0, 30.0]), 2 * np.pi * np.array([9.0, 14.0]), np.array([0.03, 0.04])
DIRECTION = np.array([0.6, 0.8])
SECONDS, FINE = 24.0, 16
SLOPE = -700.0  # N/m for each Hz of the tooth passing
NOMINAL_AT = 8.0  # Hz


def _model() -> ModalModel:
    poles = OMEGA * (-DAMPING + 1j * np.sqrt(1 - DAMPING**2))
    return ModalModel(poles, SHAPES / (2j * poles.imag * MASSES)[:, None], SHAPES.astype(complex), LABELS, LABELS)


def _simulated(force: Real, stiffness: Real) -> Real:
    """Integrate ``q'' + 2 zeta omega q' + omega^2 q = S (F - k(t) d d^T S^T q) / m`` by Newmark's mean acceleration.

    ``force`` (n, 2) and ``stiffness`` k (n,) are sampled ``FINE`` times as often as the returned accelerations.
    """
    h = 1 / (FINE * RATE)
    along = SHAPES @ DIRECTION
    coupling = np.outer(along, along) / MASSES[:, None]
    damping, spring = np.diag(2 * DAMPING * OMEGA), np.diag(OMEGA**2)
    driven = force @ SHAPES.T / MASSES
    q, v, a = np.zeros(2), np.zeros(2), driven[0].copy()
    out = np.empty((len(force), 2))
    for k in range(len(force)):
        if k:
            shifted, faster = q + h * v + h * h / 4 * a, v + h / 2 * a
            held = spring + stiffness[k] * coupling
            a = np.linalg.solve(
                np.eye(2) + h / 2 * damping + h * h / 4 * held, driven[k] - damping @ faster - held @ shifted
            )
            q, v = shifted + h * h / 4 * a, faster + h / 2 * a
        out[k] = a @ SHAPES
    return out[::FINE]


def _recorded(
    name: str, level: float, ends: tuple[float, float], stiffness: Callable[[Real, Real], Real]
) -> BandRecording:
    """Return a recording whose teeth pass at a frequency between its ``ends``, Hz; ``stiffness(t, f)`` acts, N/m."""
    rng = np.random.default_rng(sum(map(ord, name)))
    n = int(SECONDS * RATE)
    time = np.arange(FINE * n) / (FINE * RATE)
    frequency = ends[0] + (ends[1] - ends[0]) * time / SECONDS
    phase = 2 * np.pi * np.cumsum(frequency) / (FINE * RATE)
    spectra = np.zeros((2, FINE * n // 2 + 1), complex)
    band = np.fft.rfftfreq(FINE * n, 1 / (FINE * RATE)) < 60
    spectra[:, band] = rng.normal(size=(2, band.sum())) + 1j * rng.normal(size=(2, band.sum()))
    broad = np.fft.irfft(spectra, axis=1)
    force = level * np.stack([np.sin(phase + 6 * rng.random()) + 0.5 * part / part.std() for part in broad], axis=1)
    motion = _simulated(force, stiffness(time, frequency))
    force = force[::FINE]
    noisy = motion + 0.01 * motion.std(axis=0) * rng.normal(size=motion.shape)
    return BandRecording(name, RATE, force, noisy, FORCES, MOTIONS, swept_line=swept_line(force, RATE))


def _by_speed(_: Real, frequency: Real) -> Real:
    return SLOPE * (frequency - NOMINAL_AT)


def _by_time(time: Real, _: Real) -> Real:
    return SLOPE * 20.0 * (time / SECONDS - 0.2)


UP, DOWN = (8.0, 30.0), (26.0, 6.0)


def _diagnosed(ends: tuple[tuple[float, float], ...], stiffness: Callable[[Real, Real], Real]) -> StructureDiagnosis:
    levels = zip(("low", "mid", "high"), (20.0, 40.0, 80.0), ends, strict=True)
    return diagnose(_model(), [_recorded(name, level, course, stiffness) for name, level, course in levels])


@pytest.mark.long
def test_a_stiffness_that_follows_the_speed_is_named() -> None:
    diagnosis = _diagnosed((UP, DOWN, UP), _by_speed)
    assert diagnosis.verdict == "explained"
    (cause,) = [cause for cause in diagnosis.physics if cause.name != "modal_parameters"]
    assert cause.name == "speed_stiffness"
    assert "pose_drift" not in diagnosis.equivalents
    for name, value in (("stiffness_per_hz_ns_per_m", SLOPE), ("nominal_at_hz", NOMINAL_AT)):
        assert abs(cause.parameters[name] - value) < 3 * cause.standard_errors[name]


@pytest.mark.long
def test_a_stiffness_that_follows_time_is_none_that_follows_the_speed() -> None:
    diagnosis = _diagnosed((UP, DOWN, UP), _by_time)
    assert [cause.name for cause in diagnosis.physics if cause.name != "modal_parameters"] == ["pose_drift"]
    assert "speed_stiffness" not in diagnosis.equivalents


@pytest.mark.long
def test_sweeps_that_are_alike_cannot_tell_speed_from_time() -> None:
    diagnosis = _diagnosed((UP, UP, UP), _by_speed)
    named = {cause.name for cause in diagnosis.physics} - {"modal_parameters"}
    assert named | set(diagnosis.equivalents) == {"speed_stiffness", "pose_drift"}


def test_a_part_of_a_recording_holds_its_part_of_the_sweep() -> None:
    whole = replace(_recorded("x", 1.0, UP, lambda time, _: 0 * time), swept_line=UP)
    half = whole.part("half", len(whole.force) // 2, len(whole.force))
    assert half.swept_line == pytest.approx((19.0, 30.0))
