"""Recordings as shops make them: idle before the cut, orders that vary, unequal teeth, wrong speeds, any units."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from milling_simulator import SimulatedCut, simulate
from random_cuts import largest_multiplier

from millfrf.stability import ChatterVerdict, JudgedCut, classify_cut, gather_evidence

CUT = SimulatedCut(
    np.array([410.0, 560.0]), np.array([0.03, 0.03]), np.array([8e6, 9e6]), np.eye(2), 4, 0.0, pi / 2, 3000.0, krc=0.3
)  # fmt: skip
RATE, SPEED = 4000.0, 100 * pi
STABLE, CHATTERING = 1.0e-3, 6.0e-3


def recorded(depth: float, **changes: float) -> np.ndarray:
    """Accelerations of a cut of 600 tooth periods, 100 left out, with 1 % noise."""
    cut = replace(CUT, depth=depth, **changes)
    samples = simulate(cut, 600, RATE, skip=100).acceleration
    return samples + 0.01 * samples.std(axis=0) * np.random.default_rng(1).standard_normal(samples.shape)


def judged(samples: np.ndarray, speed: float = SPEED, teeth: int = 4) -> ChatterVerdict:
    return classify_cut(samples, RATE, speed, teeth)


def test_the_depths_are_on_either_side_of_the_limit() -> None:
    assert abs(largest_multiplier(CUT, STABLE)) < 0.9
    assert abs(largest_multiplier(CUT, CHATTERING)) > 1.1
    assert judged(recorded(STABLE)).kind == "stable"
    assert judged(recorded(CHATTERING)).kind == "hopf"


@pytest.mark.parametrize(("depth", "kind"), [(STABLE, "stable"), (CHATTERING, "hopf")])
def test_the_part_in_the_cut_is_judged(depth: float, kind: str) -> None:
    cut = recorded(depth)
    rng = np.random.default_rng(2)
    padded = np.pad(cut, ((3 * int(RATE), 5 * int(RATE)), (0, 0)))
    padded += 0.02 * cut.std(axis=0) * rng.standard_normal(padded.shape)
    turns = gather_evidence(padded, RATE, SPEED, 4).revolutions.count
    assert turns == pytest.approx(len(cut) / RATE * 50, abs=16)
    assert judged(padded).kind == kind


def test_orders_that_swell_and_a_speed_that_wanders_are_no_chatter() -> None:
    cut = recorded(STABLE)
    time = np.arange(len(cut)) / RATE
    late = time + 0.003 * np.cos(2 * pi * 0.3 * time) / (2 * pi * 0.3)  # 0.3 % of the speed, up and down
    wandering = np.column_stack([np.interp(late, time, column) for column in cut.T])
    swelling = wandering * (1 + 0.4 * np.cos(2 * pi * 0.3 * time + 1.0) + 0.2 * np.cos(2 * pi * 0.5 * time))[:, None]
    assert judged(swelling).kind == "stable"


@pytest.mark.parametrize("teeth", [3, 4])
def test_a_tooth_that_is_missing_is_no_period_doubling(teeth: int) -> None:
    """Of equal forces of each tooth, those of the last are taken out."""
    cut = simulate(replace(CUT, depth=STABLE, teeth=1, rpm=3000.0), 500, RATE, skip=100).acceleration
    shifts = [round(tooth * RATE / 50 / teeth) for tooth in range(teeth - 1)]
    broken = sum(np.roll(cut, shift, axis=0) for shift in shifts)
    assert judged(np.asarray(broken), teeth=teeth).kind in ("stable", "inconclusive")


@pytest.mark.parametrize("factor", [3.0, 1.05, 0.93])
def test_a_wrong_speed_is_doubted_and_no_chatter(factor: float) -> None:
    stated = judged(recorded(STABLE, runout=5e-6), factor * SPEED)
    assert stated.kind == "inconclusive"
    assert "speed" in stated.reason


def test_a_third_of_the_stated_speed_is_proposed() -> None:
    assert "probably 3000 rpm instead of 9000 rpm" in judged(recorded(STABLE, runout=5e-6), 3 * SPEED).reason


def test_units_of_another_quantity_change_nothing() -> None:
    cut = recorded(CHATTERING)
    stated = [
        classify_cut(cut * [1.0, size], RATE, SPEED, 4, quantities=("acceleration", "force")) for size in (1.0, 1e4)
    ]
    assert stated[0].kind == stated[1].kind == "hopf"
    assert stated[0].share == pytest.approx(stated[1].share)


def test_the_proposed_speed_is_stable_at_the_depth_that_chatters() -> None:
    """Of one mode with 4 teeth: the multiplier there is below 1, at the cut itself far above."""
    mode = replace(
        CUT, frequencies=CUT.frequencies[:1], damping=CUT.damping[:1], stiffnesses=CUT.stiffnesses[:1],
        directions=np.array([[1.0, 0.0]]), rpm=2300.0, depth=2.5e-3,
    )  # fmt: skip
    samples = simulate(mode, 600, RATE, skip=100).acceleration
    stated = JudgedCut("cut.h5", mode.rpm, classify_cut(samples, RATE, mode.rpm * pi / 30, 4))
    multipliers = [abs(largest_multiplier(replace(mode, rpm=rpm), mode.depth)) for rpm in stated.proposed_rpm(4)]
    assert stated.verdict.kind == "hopf"
    assert abs(largest_multiplier(mode, mode.depth)) > 1
    assert max(multipliers) < 1


@pytest.mark.parametrize(
    ("teeth", "leave", "constant"), [(4, pi, True), (3, pi, False), (2, pi, False), (4, 3.0, False)]
)
def test_forces_that_sum_to_a_constant_have_no_tooth_passing(teeth: int, leave: float, constant: bool) -> None:
    """Of the simulated motion of a stable cut with a stiff structure, without runout."""
    cut = replace(CUT, teeth=teeth, leave=leave, stiffnesses=1e4 * CUT.stiffnesses, depth=1e-3)
    turns = simulate(cut, 100 * teeth, RATE, skip=50 * teeth).acceleration
    varying = turns.std(axis=0).max() / replace(cut, teeth=2).depth
    other = simulate(replace(cut, teeth=2), 200, RATE, skip=100).acceleration.std(axis=0).max() / cut.depth
    assert cut.process.has_constant_force == constant
    assert (varying < 0.01 * other) == constant


@pytest.mark.parametrize("idle", [0, 6000])
def test_chatter_in_a_part_that_is_not_judged_is_no_stable_cut(idle: int) -> None:
    """Chatter that ceases in the first half, and a chattering cut before a longer stable one."""
    chattering, stable = recorded(CHATTERING), recorded(STABLE)
    chattering *= stable.std() / chattering.std()
    stated = judged(np.vstack([chattering, 0.01 * stable[:idle], stable, stable]))
    assert stated.kind == "inconclusive"
    begin, end = (float(word) for word in stated.reason.split("--span ")[1].rstrip(")").split())
    assert 0 <= begin < end <= (len(chattering) + 1000) / RATE
    assert judged(chattering[int(begin * RATE) :]).kind == "hopf"
