"""An error that goes with the signal: no noise is seen in it, and no cause is told for it."""

from pathlib import Path

import numpy as np
import pytest
from trial_case import diagnosed

from millfrf.mismatch.records.noise_model import SIGNAL_ERROR, fit_noise, inexactness


def test_noise_is_found_beside_an_error_of_the_signal() -> None:
    """A resonance whose lines are off by six times the noise at its peak: the noise stays as it is."""
    rng = np.random.default_rng(5)
    frequencies = np.linspace(5, 50, 900)
    measured = 300 / (1 - (frequencies / 20) ** 2 + 0.1j * frequencies / 20)[:, None]
    noise, off = ((rng.normal(size=(900, 1)) + 1j * rng.normal(size=(900, 1))) / np.sqrt(2) for _ in range(2))
    rest, through = noise + SIGNAL_ERROR * np.abs(measured) * off, np.zeros((900, 1, 1), dtype=complex)
    levels = np.sqrt(np.mean(np.abs(measured) ** 2, axis=0)), np.ones(1)
    known = fit_noise(frequencies, rest, through, levels, inexact=inexactness(measured)).response_level()
    unknown = fit_noise(frequencies, rest, through, levels).response_level()
    assert known == pytest.approx(1.0, rel=0.1)
    assert unknown > 1.5


@pytest.mark.long
def test_two_harmonics_tell_no_gain(tmp_path: Path) -> None:
    """Before: a gain error of 41 % with nothing hidden, as no model followed two harmonics to a thousandth."""
    diagnosis = diagnosed(tmp_path, "extended", 300, 4202, 8)
    assert diagnosis.verdict == "none"
    assert not diagnosis.physics


@pytest.mark.long
def test_a_drift_at_one_speed_is_found(tmp_path: Path) -> None:
    """Before: ``none``, as fits stood still where harmonics stand a thousand times above the noise."""
    diagnosis = diagnosed(tmp_path, "steady", 120, 4301, 74)
    assert [each.name for each in diagnosis.physics] == ["pose_drift"]
    assert diagnosis.improvement.after < 1.05 * diagnosis.improvement.noise_floor
