"""Cuts of the simulated cell classified from their signals, against solvers that share no stability code with it."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest

from millfrf.core import InputError
from millfrf.cutting import MillingProcess
from millfrf.stability import ChatterVerdict, classify_cut, collocation
from replay_data import MillingCell, dynamometer, table_one_model, tip_accelerometers

HALF_DOWN = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
RATE = 2048.0


def cut(rpm: float, depth: float, *, noise: float = 0.0, runout: float = 0.0, seed: int = 0) -> np.ndarray:
    """Accelerations of a simulated cut, 500 tooth periods or 20 s."""
    process = replace(HALF_DOWN, runout=runout)
    duration = max(20.0, 500 * 30 / rpm)
    sensors = dynamometer(noise) + tip_accelerometers(noise)
    cell = MillingCell(
        table_one_model(), process, depth, rpm * pi / 30, duration, sample_rate=RATE, sensors=sensors, seed=seed
    )
    return cell.samples()[:, 3:]


def verdict(rpm: float, depth: float, **options: float) -> ChatterVerdict:
    return classify_cut(cut(rpm, depth, **options), RATE, rpm * pi / 30, 2, runout=options.get("runout", 0.0))


@pytest.mark.parametrize(
    ("rpm", "depth", "kind"),
    [(800, 1.5e-3, "stable"), (800, 2.0e-3, "hopf"), (1050, 1.25e-3, "stable"), (1050, 1.6e-3, "period-doubling")],
)
def test_the_papers_kinds_of_cut(rpm: float, depth: float, kind: str) -> None:
    assert verdict(rpm, depth).kind == kind
    assert verdict(rpm, depth, noise=0.01, seed=1).kind == kind


def test_runout_is_not_taken_for_chatter_nor_chatter_for_runout() -> None:
    assert verdict(800, 1.4e-3, runout=20e-6, noise=0.01).kind == "stable"
    assert verdict(800, 2.1e-3, runout=20e-6, noise=0.01).kind == "hopf"


def test_chatter_frequency_is_not_folded() -> None:
    result = verdict(800, 1.75e-3)
    expected = collocation(table_one_model(), HALF_DOWN, np.array([800 * pi / 30]), 5e-3).chatter_frequencies[0]
    assert expected == pytest.approx(17.2, abs=0.2)
    assert result.frequency == pytest.approx(expected, abs=0.3)


def test_a_speed_that_is_half_a_per_cent_off_is_found() -> None:
    samples = cut(900, 1.3e-3, noise=0.01)
    assert classify_cut(samples, RATE, 904 * pi / 30, 2, runout=0.0).kind == "stable"


def test_short_records_are_refused() -> None:
    with pytest.raises(InputError, match="needed"):
        classify_cut(np.zeros((1000, 1)), RATE, 800 * pi / 30, 2)
    with pytest.raises(InputError, match="positive"):
        classify_cut(np.zeros((1000, 1)), RATE, -1.0, 2)


def agreement(seed: int, count: int) -> tuple[int, int]:
    """Random cuts 5 % or more off the boundary on whose stability simulation and solver agree, of how many."""
    rng = np.random.default_rng(seed)
    rpm = rng.uniform(600, 2300, count)
    below = rng.random(count) < 0.5
    factor = np.where(below, rng.uniform(0.4, 0.95, count), rng.uniform(1.05, 1.8, count))
    limits = collocation(table_one_model(), HALF_DOWN, rpm * pi / 30, 20e-3).depth_limits
    agreed = [(verdict(s, a * f).kind == "stable") == (f < 1) for s, a, f in zip(rpm, limits, factor, strict=True)]
    return sum(agreed), count


@pytest.mark.long
def test_ten_random_cuts_agree_with_the_solver() -> None:
    assert agreement(7, 10) == (10, 10)


@pytest.mark.slow
def test_two_hundred_random_cuts_agree_with_the_solver() -> None:
    assert agreement(1, 200) == (200, 200)
