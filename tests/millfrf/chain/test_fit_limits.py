"""Recordings at the limits of what laboratories bring: one sensor, and a band over an analyser's whole span."""

from pathlib import Path

import numpy as np
import pytest

from acquisition import Channel, RecordingWriter, StreamDescription
from millfrf.core import InputError
from millfrf.steps.fit import fit
from modal_fit import ModalModel

RATE, SAMPLES = 1024.0, 16384


def structure(natural: list[float], damping: list[float], n_responses: int) -> ModalModel:
    """A reciprocal structure driven at its first point."""
    omega, zeta = 2 * np.pi * np.array(natural), np.array(damping)
    poles = -zeta * omega + 1j * omega * np.sqrt(1 - zeta**2)
    shapes = np.random.default_rng(1).uniform(0.5, 1.5, (len(poles), n_responses)) + 0j
    left = shapes[:, :1] / (100j * poles.imag[:, None])
    return ModalModel(poles, shapes, left, tuple(f"P{k}:+X" for k in range(n_responses)), ("P0:+X",))


def record(path: Path, model: ModalModel) -> None:
    """A stretch of steady random vibration behind an anti-alias filter, 1 % noise on the accelerations."""
    rng, n = np.random.default_rng(0), 4 * SAMPLES
    f = np.fft.rfftfreq(n, 1 / RATE)
    force = np.fft.rfft(rng.standard_normal(n)) * np.exp(-((np.maximum(f / RATE - 0.4, 0) / 0.02) ** 2))
    frf = np.zeros((len(f), len(model.responses)), complex)
    frf[1:] = model.receptance(f[1:])[:, :, 0] * (2j * np.pi * f[1:, None]) ** 2
    motion = np.fft.irfft(force[:, None] * frf, n, axis=0)[SAMPLES : 2 * SAMPLES]
    motion += 0.01 * motion.std(axis=0) * rng.standard_normal(motion.shape)
    accelerations = [Channel(f"a{k}", "acceleration", "m/s^2", f"P{k}", "+X") for k in range(motion.shape[1])]
    stream = StreamDescription("main", RATE, 0.0, (Channel("fx", "force", "N", "P0", "+X"), *accelerations))
    with RecordingWriter(path, [stream]) as writer:
        writer.append("main", np.column_stack([np.fft.irfft(force, n)[SAMPLES : 2 * SAMPLES], motion]))


@pytest.mark.parametrize("n_responses", [1, 2])
@pytest.mark.parametrize(
    ("band", "natural"),
    [
        ((20.0, 240.0), [60.0, 150.0]),
        ((20.0, 0.39 * RATE), [60.0, 150.0, 290.0, 370.0]),
    ],
)
def test_default_fits_recover_the_structure(
    tmp_path: Path, n_responses: int, band: tuple[float, float], natural: list[float]
) -> None:
    damping = [0.02, 0.015, 0.01, 0.01]
    truth = structure([60.0, 150.0, 290.0, 370.0], damping, n_responses)
    record(tmp_path / "a.h5", truth)
    fitted = fit(tmp_path / "a.h5", band=band)
    np.testing.assert_allclose(fitted.model.natural_frequencies, natural, rtol=1e-4)
    np.testing.assert_allclose(fitted.model.damping_ratios, damping[: len(natural)], rtol=5e-3)


def test_beyond_the_flat_band_is_refused_with_the_band_that_was_asked_for(tmp_path: Path) -> None:
    record(tmp_path / "a.h5", structure([60.0], [0.02], 1))
    with pytest.raises(InputError, match=r"band up to 450 Hz does not fit .* 1024 Hz; stay below 409.6 Hz"):
        fit(tmp_path / "a.h5", band=(20.0, 450.0))
