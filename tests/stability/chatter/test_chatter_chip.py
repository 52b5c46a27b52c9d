"""What a vibration does to the chip, how its lines vary, and what runout alone would do: against what is put in."""

from dataclasses import replace
from math import inf, nan, pi

import numpy as np
import pytest
from milling_simulator import SimulatedCut, simulate
from random_cuts import largest_multiplier

from millfrf.cutting import MillingProcess
from millfrf.stability import ModelledCut, classify_cut

RATE, SPEED, TEETH, CHIP = 400.0, 20 * pi, 4, 1e-4
TIME = np.arange(int(30 * RATE)) / RATE
TURN = 10.0
"""Turns a second."""


def acceleration(*lines: tuple[float, float], seed: int = 0, noise: float = 0.02) -> np.ndarray:
    """Forced motion at tooth passing and turns, and lines of motion (Hz, m), as accelerations, two channels, noise."""
    rng = np.random.default_rng(seed)
    motion = np.zeros((len(TIME), 2))
    forced = [(order * TURN, 2e-5 * (4 / order) ** 2 * (1.0 if order % 4 == 0 else 0.05)) for order in range(1, 18)]
    for frequency, size in (*forced, *lines):
        waves = np.cos(2 * pi * frequency * TIME[:, None] + rng.uniform(0, 2 * pi, 2))
        motion += size * (2 * pi * frequency) ** 2 * waves
    return motion + noise * motion.std(axis=0) * rng.standard_normal(motion.shape)


def judged(samples: np.ndarray, chip: float = CHIP, **options: float) -> str:
    return classify_cut(samples, RATE, SPEED, TEETH, derivatives=(2, 2), chip=chip, **options).kind


def test_chatter_that_comes_close_to_an_order_is_found() -> None:
    """Before: nothing was looked for within 2.5 lines of an order. Lines at 70.15 - 40 k Hz stand beside order 7."""
    beside = [(30.15, 3e-6), (70.15, 1e-5), (110.15, 2e-6)]
    assert judged(acceleration(*beside)) == "hopf"
    varying = acceleration((69.85, 3e-6), (70.15, 3e-6))  # an order that comes and goes slowly
    assert judged(varying) == "stable"


@pytest.mark.parametrize(("size", "kind"), [(3e-5, "hopf"), (3e-7, "inconclusive")])
def test_lines_that_are_not_sharp_are_told_by_what_they_do_to_the_chip(size: float, kind: str) -> None:
    """A vibration that the teeth modulate, its phase wandering: the same share of the motion, another of the chip."""
    rng = np.random.default_rng(4)
    wander = np.cumsum(rng.standard_normal(len(TIME))) * np.sqrt(2 / RATE)
    swell = 1 + 0.4 * np.interp(TIME, np.arange(0, 32, 0.7), rng.standard_normal(46))
    motion = acceleration(noise=0.0) * size / 6e-6
    for frequency, share in ((33.0, 1.0), (73.0, 0.1)):
        wave = swell * np.cos(2 * pi * frequency * TIME + wander) * size * share
        motion += (2 * pi * frequency) ** 2 * wave[:, None]
    samples = motion + 0.02 * motion.std(axis=0) * rng.standard_normal(motion.shape)
    assert judged(samples) == kind
    assert judged(samples, chip=nan) == "stable"  # 8 % of the motion, not steady, not growing


@pytest.mark.parametrize(
    ("runout", "chip", "kind"),
    [(0.0, CHIP, "period-doubling"), (inf, CHIP, "inconclusive"), (5e-6, CHIP, "period-doubling"),
     (5e-5, CHIP, "inconclusive"), (5e-6, 20 * CHIP, "inconclusive"), (nan, nan, "inconclusive")],
)  # fmt: skip
def test_an_alternating_chip_against_the_stated_runout(runout: float, chip: float, kind: str) -> None:
    """Tool motion of 25 um at half the tooth passing of four teeth changes the chip by 35 um (root mean square)."""
    samples = acceleration((20.0, 5e-5))
    assert judged(samples, chip=chip, runout=runout) == kind


CUT = SimulatedCut(
    np.array([18.0, 27.0]), np.array([0.03, 0.04]), np.array([6e5, 9e5]), np.eye(2), 2, pi / 2, pi, 1050.0,
    depth=3.5e-3, ktc=119e6, krc=0.17, feed=0.15e-3, runout=40e-6,
)  # fmt: skip


@pytest.mark.parametrize(("depth", "kind"), [(1.5e-3, "stable"), (3.5e-3, "period-doubling")])
def test_with_the_model_two_unequal_teeth_are_told(depth: float, kind: str) -> None:
    """Runout shakes both cuts at half the tooth passing; the motion speaks for the depth, and that decides."""
    cut = replace(CUT, depth=depth)
    assert (abs(largest_multiplier(replace(cut, runout=0.0), depth)) < 1) == (kind == "stable")
    samples = simulate(cut, 500, 640.0, skip=100).acceleration
    known = {"runout": cut.runout, "derivatives": (2, 2), "chip": cut.process.thickest_chip}
    speed = cut.rpm * pi / 30
    stated = classify_cut(samples, 640.0, speed, 2, **known, modelled=ModelledCut(cut.process, cut.model, (0, 1)))
    assert stated.kind == kind
    assert f"cut of {1e3 * depth:.1f}" in stated.reason
    assert "no test" in stated.warnings[0]
    turned = ModelledCut(cut.process, cut.model, (1, 0), (-1, 1))
    assert classify_cut(samples[:, ::-1] * [1, -1], 640.0, speed, 2, **known, modelled=turned).kind == kind
    wrong = replace(cut, frequencies=np.array([12.0, 41.0]), stiffnesses=np.array([2e5, 9e6]))
    other = ModelledCut(wrong.process, wrong.model, (0, 1))
    assert classify_cut(samples, 640.0, speed, 2, **known, modelled=other).kind == "inconclusive"


def test_the_thickest_chip() -> None:
    slot = MillingProcess(2, 0.02, pi / 2, 1e9, 0.3, 0.0, 0.0, pi, 1e-4)
    assert slot.thickest_chip == pytest.approx(1e-4)
    assert replace(slot, exit_angle=pi / 6).thickest_chip == pytest.approx(0.5e-4)
    assert replace(slot, start_angle=5 * pi / 6).thickest_chip == pytest.approx(0.5e-4)
