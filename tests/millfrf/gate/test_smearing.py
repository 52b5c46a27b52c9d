"""Damping ratios of FRFs whose segments' window is as wide as a resonance: too large, and the fit says so."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from estimation import Frf, FrfCovariance, SpectralSettings, read_frf, write_frf
from estimation.spectra.cross_spectra import spectral_width
from millfrf.steps.fit import fit

FREQUENCY, DAMPING = 11.3, 0.045


def smeared(seconds: float) -> Frf:
    """A mode as Hann segments of this length show it: the mean of its lines over the window's spectrum."""
    axis = np.arange(5.0, 25.0, 0.125)
    rate, count = 128.0, int(128 * seconds)
    window = np.hanning(count + 1)[:-1]
    power = np.abs(np.fft.fftshift(np.fft.fft(window, 64 * count))) ** 2
    offset = np.fft.fftshift(np.fft.fftfreq(64 * count, 1 / rate))
    near = np.abs(offset) < 6 / seconds
    weights = power[near] / power[near].sum()
    at = axis[:, None] + offset[near][None, :]
    values = (1e-6 / (1 - (at / FREQUENCY) ** 2 + 2j * DAMPING * at / FREQUENCY)) @ weights
    unit = np.ones((len(axis), 1, 1), dtype=complex)
    width = spectral_width(SpectralSettings(count, window="hann"), rate)
    return Frf(
        axis, values[:, None, None], ("T:+X",), ("T:+X",), "receptance", "m/N", axis > 0,
        covariance=FrfCovariance(1e-18 * unit, unit), band=(5.0, 25.0), spectral_width=width,
    )  # fmt: skip


@pytest.mark.parametrize("seconds", [4.0, 8.0])
def test_a_damping_ratio_that_a_window_widens_is_doubted_by_enough(seconds: float) -> None:
    frf = smeared(seconds)
    fitted = fit(frf, band=(6.0, 20.0), modes=1)
    excess = fitted.model.damping_ratios[0] / DAMPING - 1
    (said,) = [text for text in fitted.warnings if "widens resonances" in text]
    bound = float(said.split("up to about ")[1].split(" %")[0]) / 100
    assert 0.6 * bound < excess < 1.3 * bound
    assert "1 of 1 damping ratios" in said


def test_without_a_window_or_with_long_segments_nothing_is_doubted() -> None:
    for frf in (replace(smeared(8.0), spectral_width=None), smeared(120.0)):
        fitted = fit(frf, band=(6.0, 20.0), modes=1)
        assert not any("widens resonances" in text for text in fitted.warnings)


def test_the_width_travels_with_the_file(tmp_path: Path) -> None:
    write_frf(tmp_path / "frf.h5", smeared(8.0))
    width = read_frf(tmp_path / "frf.h5").spectral_width
    assert width == pytest.approx(1 / (np.sqrt(3) * 8), rel=1e-4)
