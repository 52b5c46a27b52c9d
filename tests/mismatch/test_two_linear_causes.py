"""Two causes of the measuring chain at once, of which the likelier one alone has numbers that nothing real has."""

from collections.abc import Callable

import numpy as np
import pytest
from concealed_recordings import RATE, Real, forces, linear_acceleration, structure, trial

from estimation import BandRecording
from millfrf.mismatch import Settings, diagnose
from millfrf.mismatch.inference.settings import ScreeningSettings

RESONANCE, CORNER = 60.0, 0.8


def filtered(signals: Real, response: Callable[[Real], np.ndarray]) -> Real:
    """Signals (n, n_channels) behind a filter, by a padded Fourier transform."""
    n = 2 * len(signals)
    passed = np.fft.rfft(signals, n=n, axis=0) * response(np.fft.rfftfreq(n, 1 / RATE))[:, None]
    return np.asarray(np.fft.irfft(passed, n=n, axis=0)[: len(signals)])


def dynamometer(frequencies: Real) -> np.ndarray:
    """Measured over true force: a resonance, 5 % damped."""
    ratio = frequencies / RESONANCE
    return np.asarray(1 / (1 - ratio**2 + 0.1j * ratio))


def high_pass(frequencies: Real) -> np.ndarray:
    """Measured over true acceleration: one stage."""
    return np.asarray(1j * frequencies / (1j * frequencies + CORNER))


@pytest.fixture(scope="module")
def recordings() -> list[BandRecording]:
    made = []
    for k, level in enumerate((20.0, 40.0)):
        rng = np.random.default_rng(k)
        force = forces(rng, level, 30.0)
        answer = filtered(linear_acceleration(structure(), force), high_pass)
        made.append(trial(f"level_{k + 1}", filtered(force, dynamometer), answer, rng, 0.01))
    return made


@pytest.mark.long
@pytest.mark.parametrize("most_linear", [1, 3])
def test_what_stands_behind_an_impossible_cause_is_found(recordings: list[BandRecording], most_linear: int) -> None:
    """The dynamometer alone would have a negative damping. With the high-pass before it, it has its own."""
    settings = Settings(screening=ScreeningSettings(most_linear=most_linear))
    diagnosis = diagnose(structure(), recordings, settings)
    numbers = {cause.name: cause.parameters for cause in diagnosis.physics}
    assert diagnosis.verdict == "explained"
    assert set(numbers) == {"ac_coupling", "dynamometer_dynamics"}
    assert numbers["dynamometer_dynamics"]["resonance_hz"] == pytest.approx(RESONANCE, rel=0.01)
    assert numbers["ac_coupling"]["corner_hz"] == pytest.approx(CORNER, rel=0.02)
