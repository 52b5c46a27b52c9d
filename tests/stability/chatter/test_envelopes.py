"""Envelopes of narrow bands: noise through a mode, and chatter whose frequency wanders."""

import numpy as np
import pytest
from scipy.stats import binom

from millfrf.stability import classify_cut
from millfrf.stability.chatter.envelopes import BandEnvelope, band_envelope, noise_share
from millfrf.stability.chatter.spindle import Revolutions

RATE, SPINDLE, TEETH, COUNT = 3200.0, 50.0, 4, 400
TIME = np.arange(int(COUNT / SPINDLE * RATE)) / RATE
FORCED = sum(np.cos(2 * np.pi * k * TEETH * SPINDLE * TIME + k) / k for k in range(1, 6))


def through_a_mode(seed: int, frequency: float = 700.0, damping: float = 0.02) -> np.ndarray:
    """White noise through a mode, of root mean square 1."""
    lines = np.fft.rfftfreq(len(TIME), 1 / RATE) / frequency
    spectrum = np.fft.rfft(np.random.default_rng(seed).standard_normal(len(TIME)))
    motion = np.fft.irfft(spectrum / (1 - lines**2 + 2j * damping * lines), len(TIME))
    return np.asarray(motion / motion.std())


def wandering(teeth_side_lines: float) -> np.ndarray:
    """A line of constant size and root mean square 1, whose frequency rises by 4 %, with side lines."""
    phase = 2 * np.pi * (530.0 * TIME + 0.5 * 20.0 * TIME**2 / TIME[-1])
    return np.sqrt(2) * np.cos(phase) * (1 + teeth_side_lines * np.cos(2 * np.pi * TEETH * SPINDLE * TIME))


def envelope_at(motion: np.ndarray, frequency: float) -> BandEnvelope:
    """The test of a motion without orders."""
    samples = motion.reshape(COUNT, -1, 1)
    return band_envelope(Revolutions(samples, TEETH, 30.0), frequency / SPINDLE, np.ones((1, 1)))


def test_p_values_of_noise_through_modes_are_not_too_small() -> None:
    envelopes = [envelope_at(through_a_mode(seed), 700.0) for seed in range(200)]
    small = sum(envelope.p_value < 0.05 for envelope in envelopes)
    assert small <= binom.ppf(0.99, 200, 0.05)
    assert not any(envelope.is_steady for envelope in envelopes)
    assert np.mean([envelope.is_noise for envelope in envelopes]) > 0.9


def test_a_line_that_wanders_has_a_steady_envelope() -> None:
    envelope = envelope_at(wandering(0.0), 540.0)
    assert envelope.is_steady
    assert envelope.share == pytest.approx(1.0, rel=0.05)


def test_noise_as_large_as_the_forced_motion_is_stable() -> None:
    """Chips that break off may shake a mode as much as the teeth do."""
    noise = through_a_mode(1, damping=0.05) + through_a_mode(2, 450.0, 0.05)
    verdict = classify_cut((FORCED + noise)[:, None], RATE, SPINDLE * 2 * np.pi, TEETH)
    assert verdict.kind == "stable"
    assert "fluctuates as noise" in verdict.reason


@pytest.mark.parametrize(("side_lines", "kind"), [(0.3, "hopf"), (0.0, "stable")])
def test_chatter_that_wanders_is_told_from_a_tone_by_its_side_lines(side_lines: float, kind: str) -> None:
    motion = FORCED + 0.3 * wandering(side_lines) + 0.02 * np.random.default_rng(3).standard_normal(len(TIME))
    verdict = classify_cut(motion[:, None], RATE, SPINDLE * 2 * np.pi, TEETH)
    assert verdict.kind == kind
    if kind == "hopf":
        assert 525 < verdict.frequency < 555


def test_irregular_motion_of_one_edge_is_not_taken_for_noise() -> None:
    """Turning: an eccentric workpiece makes chatter rise and fall over each turn."""
    residual = through_a_mode(4).reshape(COUNT, -1, 1)
    weights = np.ones((1, 1))
    assert noise_share(Revolutions(residual, TEETH, 30.0), weights) > 0.9
    assert noise_share(Revolutions(residual, 1, 30.0), weights) == 0.0
