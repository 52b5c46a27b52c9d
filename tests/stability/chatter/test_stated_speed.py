"""Cuts whose stated speed may be wrong: synthetic combs whose speed is known, and simulated cuts."""

from math import pi

import numpy as np
import pytest
from milling_simulator import SimulatedCut, simulate

from millfrf.stability import ChatterVerdict, classify_cut

RATE, SPEED = 4000.0, 100 * pi


def stable_cut() -> np.ndarray:
    """Accelerations of 500 tooth periods of four equal teeth, with 1 % noise."""
    cut = SimulatedCut(
        np.array([410.0, 560.0]), np.array([0.03, 0.03]), np.array([8e6, 9e6]), np.eye(2), 4, 0.0, pi / 2, 3000.0,
        depth=1e-3, krc=0.3,
    )  # fmt: skip
    samples = simulate(cut, 600, RATE, skip=100).acceleration
    return samples + 0.01 * samples.std(axis=0) * np.random.default_rng(1).standard_normal(samples.shape)


def comb(spindle: float, teeth: int, runout: float = 0.3, seconds: float = 4.0, rate: float = 4000.0) -> np.ndarray:
    """Motion with all orders of a spindle (Hz), those of equal teeth at their full size, and 5 % noise, one channel."""
    time = np.arange(round(seconds * rate)) / rate
    rng = np.random.default_rng(3)
    motion = 0.05 * rng.standard_normal(len(time))
    for order in range(1, 6 * teeth):
        size = (1.0 if order % teeth == 0 else runout) / (1 + order / teeth)
        motion += size * np.cos(2 * pi * order * spindle * time + rng.uniform(0, 2 * pi))
    return motion[:, None]


def told(samples: np.ndarray, spindle: float, teeth: int, rate: float = 4000.0) -> ChatterVerdict:
    return classify_cut(samples, rate, 2 * pi * spindle, teeth, only_stated=True)


@pytest.mark.parametrize("error", [-0.15, -0.025, 0.0, 0.017, 0.1])
@pytest.mark.parametrize("teeth", [2, 5])
def test_a_cut_is_judged_at_the_speed_of_its_lines(error: float, teeth: int) -> None:
    result = told(comb(42.0, teeth), 42.0 * (1 + error), teeth)
    assert result.kind == "stable"
    assert result.spindle_speed / (2 * pi) == pytest.approx(42.0, rel=1e-3)


def test_an_error_of_the_speed_looks_like_chatter_where_it_is_said_to_be_measured() -> None:
    """So that the cuts above show what the comb is for."""
    assert classify_cut(comb(42.0, 5), 4000.0, 2 * pi * 42.0 * 1.1, 5).kind != "stable"


@pytest.mark.parametrize(("factor", "rpm"), [(3.0, 2520), (1.5, 2520)])
def test_a_speed_far_from_the_stated_one_is_named(factor: float, rpm: float) -> None:
    result = told(comb(42.0, 4), 42.0 * factor, 4)
    assert result.kind == "inconclusive"
    assert f"{rpm} rpm" in result.reason


def test_hum_is_no_spindle() -> None:
    cut = comb(42.0, 4, seconds=8.0)
    time = np.arange(len(cut))[:, None] / 4000
    hum = sum(0.3 / number * np.cos(2 * pi * 50 * number * time + number) for number in range(1, 30))
    result = told(cut + hum, 42.0, 4)
    assert result.kind != "inconclusive" or "rpm" not in result.reason
    assert result.spindle_speed / (2 * pi) == pytest.approx(42.0, rel=1e-3)


def test_chatter_is_no_other_speed() -> None:
    """Side lines at the tooth passing and at the spindle; of the orders only the tooth passing is above the noise."""
    time = np.arange(32000) / 4000
    noise = 0.02 * np.random.default_rng(4).standard_normal(len(time))
    shift = 2 * pi * 27.6 * time
    motion = np.cos(2 * pi * 899.3 * time) * (
        1 + 0.3 * np.cos(shift) + 0.2 * np.cos(2 * shift) + 0.4 * np.cos(6 * shift)
    )
    orders = 0.2 * np.cos(6 * shift + 1.0)
    result = told((motion + orders + noise)[:, None], 27.6, 6)
    assert result.kind == "hopf"
    assert result.frequency == pytest.approx(899.3, abs=0.5)


@pytest.mark.parametrize(("factor", "verdict"), [(1.0, "hopf"), (2.0, "inconclusive")])
def test_the_side_lines_of_chatter_show_another_speed(factor: float, verdict: str) -> None:
    """Three teeth: the chatter has lines at ``f + k f_tooth``, the orders at the tooth passing."""
    time = np.arange(48000) / 8000
    noise = 0.003 * np.random.default_rng(5).standard_normal(len(time))
    tooth = 3 * 2 * pi * 61.3 * time
    modulation = 1 + 0.4 * np.cos(tooth) + 0.2 * np.cos(2 * tooth + 1.0) + 0.1 * np.cos(3 * tooth)
    motion = np.cos(2 * pi * 1121.7 * time) * modulation + 0.05 * np.cos(tooth + 1.0) + 0.03 * np.cos(2 * tooth)
    result = told((motion + noise)[:, None], 61.3 * factor, 3, rate=8000.0)
    assert result.kind == verdict
    if factor != 1.0:
        assert "3678 rpm" in result.reason


def test_twice_the_speed_is_no_period_doubling_unless_it_was_measured() -> None:
    """An even number of equal teeth at half the speed has the lines of period doubling."""
    cut = stable_cut()
    measured = classify_cut(cut, RATE, 2 * SPEED, 4, runout=0.0)
    stated = classify_cut(cut, RATE, 2 * SPEED, 4, runout=0.0, only_stated=True)
    assert measured.kind == "period-doubling"
    assert stated.kind == "inconclusive"
    assert "3000 rpm" in stated.reason


def test_orders_that_equal_teeth_do_not_cause_are_told() -> None:
    """Three equal teeth at a third of the stated speed: the same lines as of three unequal teeth."""
    result = told(comb(42.0, 3, runout=0.0), 126.0, 3)
    assert result.kind == "inconclusive" or any("2520 rpm" in warning for warning in result.warnings)


@pytest.mark.parametrize("cut_off", [None, 900.0])
def test_the_noise_of_a_microphone_is_no_irregular_chatter(cut_off: float | None) -> None:
    """White noise as large as the motion of a stable cut, also where a codec cuts it off."""
    cut = stable_cut()[:, :1]
    noise = np.random.default_rng(5).standard_normal(cut.shape)
    if cut_off is not None:
        spectrum = np.fft.rfft(noise, axis=0)
        spectrum[np.fft.rfftfreq(len(noise), 1 / RATE) > cut_off] *= 1e-4
        noise = np.fft.irfft(spectrum, len(noise), axis=0)
    result = classify_cut(cut + cut.std() * noise / noise.std(), RATE, SPEED, 4)
    assert result.kind == "stable"
    assert result.deviation > 0.6


def test_turning_chatters_without_a_line_of_the_workpiece() -> None:
    """A single edge that never leaves the cut: chatter that the workpiece modulates, after two seconds of air."""
    rng = np.random.default_rng(6)
    time = np.arange(40 * 407) / 407
    motion = np.cos(2 * pi * 97.3 * time) * (
        1 + 0.3 * np.cos(2 * pi * 9.15 * time) + 0.1 * np.cos(2 * pi * 18.3 * time)
    )
    runout = 0.05 * np.cos(2 * pi * 9.15 * time) + 0.05 * np.cos(4 * pi * 9.15 * time)
    samples = 0.02 * rng.standard_normal(len(time)) + motion * (time > 2) + runout
    assert told(samples[:, None], 9.15, 1, 407.0).kind == "hopf"
