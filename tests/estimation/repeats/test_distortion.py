"""Distortion is found where a cubic and a quadratic spring put it, and nowhere in a linear system."""

import numpy as np
import pytest

from estimation import SteadyPeriods, distortion, excited_lines, homogeneity, linear_approximation, steady_periods

from .oscillator import DAMPING, NATURAL, RATE, multisine, noisy, steady

NOISE = (0.002, 0.005)
ODD = np.arange(11, 64, 4)
"""Odd lines, every second one left out for detection."""

ODD_IN, EVEN_IN = "odd lines in the band", "even lines in the band"


def periods(
    seed: int, level: float = 1.0, lines: np.ndarray = ODD, realisations: int = 1, **law: float
) -> SteadyPeriods:
    """Steady periods of noisy realisations of one oscillator."""
    forces = level * np.stack([multisine(seed + 50 * k, lines) for k in range(realisations)], axis=1)
    force, response = steady(forces, 5, **law)
    return steady_periods(
        [noisy(f"r{k}", force[:, k], response[:, k], NOISE, 100 * seed + k) for k in range(realisations)]
    )


def test_lines_that_were_left_out_are_found() -> None:
    cut = periods(0)
    assert cut.numbers[excited_lines(cut)].tolist() == ODD.tolist()


def test_a_cubic_spring_reaches_odd_lines_and_third_harmonics_only() -> None:
    result = {each.name: each for each in distortion(periods(1, cubic=0.05)).classes}
    assert result[ODD_IN].p_values[0] < 1e-100
    assert result[ODD_IN].level[0] > 0.02
    assert result["lines from twice to three times the band's end, odd"].p_values[0] < 1e-6
    assert result[EVEN_IN].p_values[0] > 1e-3
    assert result["lines above the band, up to twice its end, even"].p_values[0] > 1e-3


def test_a_quadratic_spring_reaches_even_lines() -> None:
    result = {each.name: each for each in distortion(periods(2, quadratic=0.02)).classes}
    assert result[EVEN_IN].p_values[0] < 1e-100
    assert result[EVEN_IN].level[0] > 3 * result[ODD_IN].level[0]
    assert result["lines above the band, up to twice its end, even"].p_values[0] < 1e-6


def test_the_level_at_detection_lines_is_that_of_the_motion_without_noise() -> None:
    forces = multisine(1, ODD)[:, None]
    _, clean = steady(forces, 2, cubic=0.05)
    lines = np.abs(np.fft.rfft(clean[-512:, 0]))
    left = np.setdiff1d(np.arange(13, 63, 2), ODD)
    true = np.sqrt(np.mean(lines[left] ** 2) / np.mean(lines[ODD] ** 2))
    result = {each.name: each for each in distortion(periods(1, cubic=0.05)).classes}
    assert result[ODD_IN].level[0] == pytest.approx(true, rel=0.02)


def test_sentences_name_what_was_found() -> None:
    said = distortion(periods(1, cubic=0.05)).sentences()
    assert any(each.startswith("distortion at odd lines in the band: -") for each in said)
    assert not any("even" in each for each in said)


@pytest.fixture(scope="module")
def linear_response() -> tuple[np.ndarray, np.ndarray]:
    return steady(np.stack([multisine(k, ODD) for k in range(4)], axis=1), 5)


@pytest.mark.long
def test_no_distortion_is_claimed_of_a_linear_system(linear_response: tuple) -> None:
    """200 seeds: p-values of each class and between realisations below 5 % in about 5 % of them."""
    force, response = linear_response
    small: dict[str, int] = {}
    claimed = 0
    for seed in range(200):
        result = distortion(
            steady_periods([noisy(f"r{k}", force[:, k], response[:, k], NOISE, 7000 + 10 * seed + k) for k in range(4)])
        )
        values = {each.name: each.p_values[0] for each in result.classes}
        values["between realisations"] = result.stochastic_p_values[0]
        for name, p in values.items():
            small[name] = small.get(name, 0) + (p < 0.05)
        claimed += any(p < 1e-3 for p in values.values())
    assert len(small) >= 6
    assert all(2 <= count <= 19 for count in small.values()), small
    assert claimed <= 5


def test_realisations_of_a_cubic_spring_differ_beyond_noise() -> None:
    result = distortion(periods(3, realisations=4, cubic=0.05))
    assert result.stochastic_p_values[0] < 1e-100
    assert result.stochastic[0] > 0.02
    assert any("realisations differ beyond noise" in each for each in result.sentences())


def test_a_realisation_played_twice_counts_once() -> None:
    cut = periods(3, realisations=2, cubic=0.05)
    twice = steady_periods(
        [noisy(str(k), *(x[:, 0] for x in steady(multisine(3, ODD)[:, None], 5)), NOISE, k) for k in range(2)]
    )
    assert linear_approximation(cut).total_freedom == 1
    assert linear_approximation(twice).total is None


def test_best_linear_approximation_of_a_linear_system_is_its_frf(linear_response: tuple) -> None:
    force, response = linear_response
    linear = linear_approximation(
        steady_periods([noisy(f"r{k}", force[:, k], response[:, k], NOISE, k) for k in range(4)])
    )
    s = 2j * np.pi * linear.frf.frequencies
    w = 2 * np.pi * NATURAL
    true = w**2 / (s**2 + 2 * DAMPING * w * s + w**2) * np.sinc(linear.frf.frequencies / RATE) ** 2
    exact = np.fft.rfft(response[-512:, 0])[ODD] / np.fft.rfft(force[-512:, 0])[ODD]
    assert np.abs(linear.frf.values[:, 0, 0] - exact).max() < 0.02
    assert np.linalg.norm(exact - true) < 0.01 * np.linalg.norm(true)  # the integrator's own error
    size = np.abs(linear.frf.values[:, 0, 0] - exact) ** 2 / linear.frf.covariance.variance()[:, 0, 0]
    assert 0.4 < size.mean() < 2.5


def test_homogeneity_alarms_at_the_stated_rate(linear_response: tuple) -> None:
    """200 seeds of a linear oscillator at two levels: 5 % of the p-values lie below 5 %."""
    force, response = linear_response
    small = 0
    for seed in range(200):
        levels = [
            steady_periods([noisy("r", level * force[:, 0], level * response[:, 0], NOISE, 9000 + 10 * seed + k)])
            for k, level in enumerate((1.0, 3.0))
        ]
        small += homogeneity(*levels).p_values[0] < 0.05
    assert 3 <= small <= 19


def test_homogeneity_measures_the_change_of_a_cubic_spring() -> None:
    low, high = periods(4, 0.5, cubic=0.02), periods(4, 1.5, cubic=0.02)
    result = homogeneity(low, high)
    assert result.p_values[0] < 1e-100
    assert result.differing.sum() > 10
    assert abs(result.largest[0] - NATURAL) < 15
    assert result.levels == pytest.approx((0.5, 1.5), rel=0.01)
    assert "the same realisation" in result.statement
    true = [linear_approximation(each).frf.values for each in (low, high)]
    assert result.change[0] == pytest.approx(np.linalg.norm(true[1] - true[0]) / np.linalg.norm(true[0]), rel=0.01)
