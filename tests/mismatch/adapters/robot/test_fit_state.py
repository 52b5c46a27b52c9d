"""Where a fit stands: its cost by hand, its gradient by differences, and what a step does to the modes."""

import numpy as np
import pytest
from milled_robots import ROBOT, cost_at, shifted, small_case, white_noise

from millfrf.mismatch import predicted_spectrum
from millfrf.mismatch.robot.fit import FitProblem, companion_penalty, numbered
from millfrf.robot_model import possible_changes, with_joint_factor

CHANGES = {change.name: change for change in possible_changes(ROBOT)}
SOFTER = with_joint_factor(ROBOT, "3", 0.7)
START = ((CHANGES["joint 3 stiffness"], 0.8), *numbered(CHANGES["payload"], 4.0))


def test_the_gradient_is_half_the_fall_of_the_cost() -> None:
    """By differences of the cost itself, which also holds the leakage that the derivatives leave out."""
    case = small_case(SOFTER)
    white = white_noise(case)
    changes, count = START, len(START)
    u = [0.2 * np.random.default_rng(1).normal(size=each.size) for each in case.modes(changes)]
    state = FitProblem(case, tuple(white)).state(changes, u)
    _, gradient = state.normal
    numeric = np.zeros(count + len(u[0]))
    for place in range(len(numeric)):
        sides = []
        for by in (1e-4, -1e-4):
            numbers = shifted(changes, place, by) if place < count else changes
            moved = u[0] + by * (np.arange(len(u[0])) == place - count)
            sides.append(cost_at(case, numbers, white, moved, state.modes[0]))
        numeric[place] = -0.5 * (sides[0] - sides[1]) / 2e-4
    assert np.linalg.norm(gradient - numeric) < 0.05 * np.linalg.norm(numeric)
    large = np.abs(numeric) > 0.05 * np.abs(numeric).max()
    assert (np.sign(gradient[large]) == np.sign(numeric[large])).all()


def test_the_cost_is_misfit_and_belief() -> None:
    case = small_case(SOFTER)
    white = white_noise(case)
    u = 0.2 * np.random.default_rng(1).normal(size=case.modes(START)[0].size)
    state = FitProblem(case, tuple(white), 0.01).state(START, [u])
    spectrum = case.recordings[0].spectrum
    rest = spectrum.measured - predicted_spectrum(case.modes(START)[0].moved(u, case.error), spectrum)
    misfit = 2 * sum(np.linalg.norm(white[0][k] @ rest[k]) ** 2 for k in range(len(rest)))
    assert state.cost == pytest.approx(misfit + 0.01 * u @ u + companion_penalty(START))


def test_doubt_counts_companions_in_units_of_their_belief() -> None:
    companions = CHANGES["payload"].companions
    numbers = tuple((each, each.centre + 2 * each.spread) for each in companions)
    assert companion_penalty(((CHANGES["payload"], 50.0), *numbers)) == pytest.approx(4 * len(companions))
    assert companion_penalty(((CHANGES["damping"], 3.0),)) == 0.0


def test_a_step_of_a_number_moves_the_modes_as_seen_by_their_derivative() -> None:
    """A joint times 0.75 instead of 0.8: frequencies as seen follow the derivative, which is nearly the truth here."""
    case = small_case(SOFTER)
    start = ((CHANGES["joint 3 stiffness"], 0.8),)
    state = FitProblem(case, tuple(white_noise(case))).state(start)
    nothing = np.zeros(1 + state.modes[0].size)
    still = state.moved(nothing)
    assert still.cost == pytest.approx(state.cost, rel=1e-9)
    moved = state.moved(np.concatenate([[np.log(0.75 / 0.8)], nothing[1:]]))
    assert moved.changes[0][1] == pytest.approx(0.75)
    truth = case.modes(((CHANGES["joint 3 stiffness"], 0.75),))[0].aligned(state.modes[0])
    assert moved.deviated_modes[0].natural[:4] == pytest.approx(truth.natural[:4], rel=2e-3)
    fixed = state.moved(np.concatenate([[0.0], np.eye(len(nothing) - 1)[0]]))
    assert fixed.deviated_modes[0].natural[0] == pytest.approx(
        state.deviated_modes[0].natural[0] * np.exp(case.error.frequency)
    )
