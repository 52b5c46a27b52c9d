"""What must not be taken for chatter, and what must, on cuts of a simulator that shares no code with the project."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from milling_simulator import SimulatedCut, simulate
from random_cuts import largest_multiplier

from millfrf.stability import classify_cut

CUT = SimulatedCut(
    np.array([18.0, 27.0]),
    np.array([0.03, 0.04]),
    np.array([6e5, 9e5]),
    np.array([[1.0, 0.0], [0.0, 1.0]]),
    teeth=2,
    start=pi / 2,
    leave=pi,
    rpm=800.0,
    depth=1.0e-3,
    ktc=119e6,
    krc=0.17,
    feed=0.15e-3,
)
RATE = 640.0
STATED = CUT.rpm * pi / 30


def stable(periods: int = 400) -> np.ndarray:
    """A steady stable cut, the entry left out."""
    return simulate(CUT, periods + 100, RATE, skip=100).acceleration


def test_noise_of_ten_per_cent_is_no_chatter() -> None:
    samples = stable()
    noise = 0.1 * samples.std(axis=0) * np.random.default_rng(1).standard_normal(samples.shape)
    verdict = classify_cut(samples + noise, RATE, STATED, 2)
    assert verdict.kind == "stable"
    assert verdict.p_value > 1e-4


def test_a_tone_of_the_mains_is_named() -> None:
    samples = stable()
    time = np.arange(len(samples)) / RATE
    tone = 0.1 * np.sqrt(2) * samples.std(axis=0) * np.cos(2 * pi * 50 * time)[:, None]
    verdict = classify_cut(samples + tone, RATE, STATED, 2)
    assert verdict.kind == "stable"
    assert [tone.name for tone in verdict.foreign] == ["mains (1 x 50 Hz)"]
    assert verdict.foreign[0].share == pytest.approx(0.1, rel=0.1)


def test_pure_noise_is_not_judged() -> None:
    verdict = classify_cut(np.random.default_rng(2).standard_normal((20000, 2)), RATE, STATED, 2)
    assert verdict.kind == "inconclusive"
    assert "no order of the spindle" in verdict.reason


def test_hopf_chatter_with_runout_is_found_with_its_frequency() -> None:
    cut = replace(CUT, depth=4.5e-3, runout=20e-6)
    samples = simulate(cut, 500, RATE, skip=100).acceleration
    noise = 0.2 * samples.std(axis=0) * np.random.default_rng(3).standard_normal(samples.shape)
    verdict = classify_cut(
        samples + noise, RATE, 1.008 * STATED, 2, derivatives=(2, 2), natural_frequencies=(18.0, 27.0)
    )
    assert verdict.kind == "hopf"
    assert verdict.p_value < 1e-6
    assert verdict.spindle_speed == pytest.approx(STATED, rel=3e-4)
    tooth = CUT.rpm / 30
    turn = np.angle(largest_multiplier(replace(cut, runout=0.0), cut.depth)) / (2 * pi)
    assert verdict.frequency == pytest.approx((1 - abs(turn)) * tooth, abs=0.3)  # 17 Hz, not 9.6


def test_two_unequal_teeth_that_may_double_their_period_are_not_called_stable() -> None:
    cut = replace(CUT, rpm=1050.0, depth=3.5e-3, runout=20e-6)
    samples = simulate(cut, 500, RATE, skip=100).acceleration
    verdict = classify_cut(samples, RATE, cut.rpm * pi / 30, 2)
    assert verdict.kind == "inconclusive"
    assert "runout" in verdict.reason
    equal = simulate(replace(cut, runout=0.0), 500, RATE, skip=100).acceleration
    doubled = classify_cut(equal, RATE, cut.rpm * pi / 30, 2, runout=0.0)
    assert doubled.kind == "period-doubling"
    assert doubled.frequency == pytest.approx(17.5, abs=0.05)
    assert "runout" in doubled.warnings[0]


def test_a_drifting_speed_is_followed() -> None:
    samples = simulate(replace(CUT, drift=4e-3), 500, RATE, skip=100).acceleration
    verdict = classify_cut(samples, RATE, 0.99 * STATED, 2)
    assert verdict.kind == "stable"
    assert verdict.drift == pytest.approx(4e-3 * 5 / 6, rel=0.1)


def test_a_record_of_another_speed_says_so() -> None:
    verdict = classify_cut(stable(), RATE, 1.05 * STATED, 2)
    assert verdict.kind == "inconclusive"
