"""Noise levels are right within their confidence intervals, whatever they rest on, and fit spectra of other lengths."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.stats import chi2

from estimation import BandRecording, MeasuredNoise, find_repeats, noise_of_periods, steady_periods, windowed_spectrum
from estimation.repeats.noise import noise_bound, noise_in_silence
from estimation.repeats.noise_between_periods import measured_noise, noise_of_repeats
from millfrf.core import InputError

from .oscillator import CHANNELS, PERIOD, RATE, motion, multisine, noisy, recording, steady

LINES = np.arange(10, 100)
BAND = (10.0, 100.0)
TRUE = (0.02, 0.05)
"""Standard deviations of force and response noise; the force has one, the response about three."""


@pytest.fixture(scope="module")
def clean() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    force, response = steady(multisine(0, LINES)[:, None], 6)
    return force[:, 0], response[:, 0]


def measured(clean: tuple[NDArray[np.float64], NDArray[np.float64]], seed: int) -> MeasuredNoise:
    return noise_of_periods(steady_periods([noisy("r", *clean, TRUE, seed)]).within(BAND))


def test_intervals_hold_the_true_level_of_the_noise(clean: tuple) -> None:
    """200 seeds, 95 % intervals of the mean variance over the lines and of single lines, forces and responses."""
    inside = {"force": 0, "response": 0, "one line": 0}
    for seed in range(200):
        noise = measured(clean, seed)
        n, freedom = len(noise.frequencies), 5  # six periods
        bounds = chi2.ppf([0.025, 0.975], 2 * freedom * n) / (2 * freedom * n)
        for name, part, true in (("force", noise.forces, TRUE[0]), ("response", noise.responses, TRUE[1])):
            # averaged lines at either end count twice: the middle is compared line by line
            ratio = part[:, 0, 0].real.mean() / true**2
            inside[name] += bounds[0] - 0.003 < ratio < bounds[1] + 0.003
        line = noise.responses[n // 2, 0, 0].real / TRUE[1] ** 2 * 2 * noise.freedom
        low, high = chi2.ppf([0.025, 0.975], 2 * noise.freedom)
        inside["one line"] += low < line < high
    assert all(180 <= count <= 198 for count in inside.values()), inside


def test_covariance_of_a_residual_holds_the_noise_of_the_forces(clean: tuple) -> None:
    noise = measured(clean, 1)
    through = np.full((len(noise.frequencies), 1, 1), 4.0 + 3.0j)
    own = noise.covariance(noise.frequencies, through)[:, 0, 0].real.mean()
    assert own == pytest.approx(TRUE[1] ** 2 + 25 * TRUE[0] ** 2, rel=0.1)
    assert noise.response_level() == pytest.approx([TRUE[1]], rel=0.06)
    assert noise.kind == "periods"
    assert "6 steady periods of 1 s" in noise.statement


def test_noise_fits_windowed_spectra_of_other_lengths(clean: tuple) -> None:
    """Coloured noise measured between periods of a second is that of the lines of another record of 3.7 s."""

    def coloured(seed: int, n: int) -> NDArray[np.float64]:
        return np.asarray(lfilter([0.1], [1.0, -0.9], np.random.default_rng(seed).normal(size=n + 100))[100:])

    periods = [
        steady_periods([recording("r", clean[0], clean[1] + coloured(seed, len(clean[1])))]) for seed in range(20)
    ]
    noises = [noise_of_periods(each.within((2.0, 200.0))) for each in periods]
    ratios = []
    for seed, noise in enumerate(noises):
        other = recording("other", np.ones(1900), coloured(100 + seed, 1900))
        lines = windowed_spectrum(other, (5.0, 180.0), 50.0)
        own = noise.at(lines.frequencies).responses[:, 0, 0].real
        ratios.append(np.mean(np.abs(lines.measured[:, 0]) ** 2 / own))
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.05)
    faster = noises[0].at(np.array([50.0]), rate=2 * RATE)
    assert faster.responses == pytest.approx(2 * noises[0].at(np.array([50.0])).responses)
    with pytest.raises(InputError, match="measure it in that band"):
        noises[0].at(np.array([250.0]))


def test_a_transient_is_left_out() -> None:
    period = np.tile(multisine(3, LINES), 9)
    slow = period[:, None] * 1.0
    response = motion(slow)[:, 0] + 8 * np.exp(-np.arange(len(period)) / 150) * np.cos(np.arange(len(period)) / 3)
    cut = steady_periods([noisy("r", period, response, TRUE, 0)])
    assert 1 <= cut.realisations[0].left_out <= 3
    noise = noise_of_periods(cut.within(BAND))
    assert noise.response_level() == pytest.approx([TRUE[1]], rel=0.1)
    assert "left out as transient" in noise.statement


def test_a_drift_is_reported(clean: tuple) -> None:
    growth = 1 + 0.01 * np.arange(len(clean[1])) / PERIOD
    said = noise_of_periods(steady_periods([noisy("r", clean[0], clean[1] * growth, (0, 1e-3), 0)])).statement
    assert "drift slowly" in said
    assert "drift" not in measured(clean, 0).statement


def test_fractional_periods_give_the_same_noise() -> None:
    period, n = 500.37, 4100
    k = np.arange(10, 100)
    phase = 2 * np.pi * np.random.default_rng(0).random(len(k))
    angle = 2 * np.pi * np.outer(np.arange(n) / period, k) + phase
    force, response = np.cos(angle).sum(axis=1), 2 * np.cos(angle + 0.3).sum(axis=1)
    noise = noise_of_periods(steady_periods([noisy("r", force, response, TRUE, 0)]).within(BAND))
    assert noise.response_level() == pytest.approx([TRUE[1]], rel=0.06)


def test_repeats_of_one_random_force() -> None:
    force = np.random.default_rng(0).normal(size=2000)
    response = motion(force[:, None])[:, 0]
    repeats = [noisy(f"r{seed}", force, response, TRUE, seed) for seed in range(4)]
    noise = noise_of_repeats(repeats, BAND)
    assert noise.response_level() == pytest.approx([TRUE[1]], rel=0.06)
    assert measured_noise(repeats, BAND).kind == "repeats"
    other = noisy("other", np.random.default_rng(1).normal(size=2000), response, TRUE, 0)
    with pytest.raises(InputError, match="do not hold one force twice"):
        noise_of_repeats([repeats[0], other], BAND)


def test_silence_once_the_structure_rang_out() -> None:
    """100 seeds: the mean level is that of the noise within 2 %, though the structure rings into the silence."""
    levels = []
    for seed in range(100):
        force = np.zeros(6000)
        force[1000:3000] = np.random.default_rng(seed).normal(size=2000)
        response = motion(force[:, None])[:, 0] if seed == 0 else response  # noqa: F821
        single = noisy("r", force, response, (1e-3, TRUE[1]), seed)
        noise = noise_in_silence([single], BAND)
        assert noise is not None
        levels.append(noise.response_level()[0])
    assert np.mean(levels) == pytest.approx(TRUE[1], rel=0.02)
    assert "rang out" in noise.statement
    loud = noisy("r", np.random.default_rng(0).normal(size=6000), response, TRUE, 0)
    assert noise_in_silence([loud], BAND) is None


def test_the_bound_is_the_noise_of_a_linear_system_and_more_of_a_nonlinear_one() -> None:
    force = np.random.default_rng(0).normal(size=(8000, 1))
    linear, cubic = motion(force)[:, 0], motion(force, cubic=0.05)[:, 0]
    noise = noise_bound([noisy("r", force[:, 0], linear, (0.0, TRUE[1]), 0)], BAND)
    assert noise.response_level() == pytest.approx([TRUE[1]], rel=0.1)
    assert noise.kind == "local polynomial, an upper bound"
    assert "an upper bound" in noise.statement
    assert noise_bound([noisy("r", force[:, 0], cubic, (0.0, TRUE[1]), 0)], BAND).response_level() > 1.5 * TRUE[1]
    assert measured_noise([noisy("r", force[:, 0], linear, TRUE, 0)], BAND).kind == noise.kind


def test_no_bound_from_forces_that_repeat(clean: tuple) -> None:
    with pytest.raises(InputError, match="the forces repeat"):
        noise_bound([noisy("r", *clean, TRUE, 0)], BAND)


def test_forces_that_do_not_repeat_have_no_periods() -> None:
    force = np.random.default_rng(0).normal(size=(3000, 1))
    assert find_repeats(force) is None
    with pytest.raises(InputError, match="do not repeat"):
        steady_periods([BandRecording("r", RATE, force, force, *CHANNELS)])
