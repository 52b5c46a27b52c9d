"""The fit against differences of its cost, against all its neighbours, and against the number that was concealed."""

import numpy as np
import pytest
from milled_robots import ROBOT, small_case
from numpy.typing import NDArray

from mismatch.adapters.robot import PosedRobot, fit_robot
from mismatch.adapters.robot.fit import _Problem, _State, start_cost
from mismatch.adapters.robot.posed_robot import Changes
from mismatch.adapters.robot.receptance import RobotModes, predicted_spectrum
from mismatch.adapters.robot.start import numbered
from robot_model import Companion, possible_changes, with_joint_factor, with_payload

Real = NDArray[np.float64]

CHANGES = {change.name: change for change in possible_changes(ROBOT)}
PAYLOAD = with_payload(ROBOT, 12.0)
SOFTER = with_joint_factor(ROBOT, "3", 0.7)


def white_noise(case: PosedRobot) -> list[NDArray[np.complex128]]:
    """Whitening as if noise were three per cent of each response."""
    made = []
    for one in case.recordings:
        level = 0.03 * np.sqrt(np.mean(np.abs(one.spectrum.measured) ** 2, axis=0))
        shape = (len(one.spectrum.frequencies), len(level), len(level))
        made.append(np.broadcast_to(np.diag(1 / level).astype(complex), shape))
    return made


def cost_at(
    case: PosedRobot, changes: Changes, white: list[NDArray[np.complex128]], u: Real, reference: RobotModes
) -> float:
    """Cost at any point, the modes in the order and with the signs of a reference."""
    modes = case.modes(changes)[0].aligned(reference)
    return _State(_Problem(case, tuple(white), 1.0), changes, (modes,), (u,)).cost


def shifted(changes: Changes, which: int, by: float) -> Changes:
    """One number's coordinate shifted."""
    change, number = changes[which]
    return (*changes[:which], (change, change.from_fit(change.to_fit(number) + by)), *changes[which + 1 :])


def test_the_gradient_is_half_the_fall_of_the_cost() -> None:
    """By differences of the cost itself, which also holds the leakage that the derivatives leave out."""
    case = small_case(SOFTER)
    white = white_noise(case)
    changes = ((CHANGES["joint 3 stiffness"], 0.8), *numbered(CHANGES["payload"], 4.0))
    count = len(changes)
    u = [0.2 * np.random.default_rng(1).normal(size=one.size) for one in case.modes(changes)]
    state = _Problem(case, tuple(white), 1.0).state(changes, u)
    assert state.cost == start_cost(case, changes, white, u)
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


@pytest.mark.parametrize("truth", [SOFTER, PAYLOAD], ids=["joint 3", "payload"])
def test_a_fit_ends_at_the_number_and_below_all_its_neighbours(truth: object) -> None:
    case = small_case(SOFTER if truth is SOFTER else PAYLOAD)
    white = white_noise(case)
    name, number = ("joint 3 stiffness", 0.7) if truth is SOFTER else ("payload", 12.0)
    start = numbered(CHANGES[name], 0.8 if truth is SOFTER else 8.0)
    fitted = fit_robot(case, start, white)
    assert abs(fitted.changes[0][1] - number) < 3 * fitted.standard_errors[0]
    spectrum, u, seen = case.recordings[0].spectrum, fitted.deviations[0], fitted.modes[0]
    rest = np.einsum("kij,kj->ki", white[0], spectrum.measured - predicted_spectrum(seen, spectrum))
    assert fitted.misfit == pytest.approx(2 * np.sum(np.abs(rest) ** 2), rel=1e-9)
    assert fitted.cost == pytest.approx(cost_at(case, fitted.changes, white, u, seen), rel=1e-9)
    assert fitted.cost < start_cost(case, start, white, [np.zeros_like(u) for u in fitted.deviations])
    rng = np.random.default_rng(0)
    for which in range(len(start)):
        for by in (0.05, -0.05):
            moved = shifted(fitted.changes, which, by)
            assert cost_at(case, moved, white, u, seen) > fitted.cost - 0.1
    for _ in range(10):
        aside = u + 0.1 * rng.normal(size=len(u))
        assert cost_at(case, fitted.changes, white, aside, seen) > fitted.cost - 0.1


def test_a_score_is_cost_and_the_price_of_every_number() -> None:
    case = small_case(PAYLOAD)
    fitted = fit_robot(case, numbered(CHANGES["payload"], 8.0), white_noise(case))
    rows = list(zip(fitted.changes, fitted.standard_errors, strict=True))
    price, doubt = np.log(case.values), 0.0
    for (one, number), error in rows:
        if isinstance(one, Companion):
            price += max(2 * np.log(one.spread / error), 0.0)
            doubt += ((number - one.centre) / one.spread) ** 2
    assert len(rows) == 1 + len(CHANGES["payload"].companions) > 1
    assert fitted.price == pytest.approx(price)
    assert fitted.doubt == pytest.approx(doubt)
    assert fitted.deviation == pytest.approx(sum(u @ u for u in fitted.deviations))
    assert fitted.score == pytest.approx(fitted.misfit + fitted.deviation + doubt + price)
    assert 0 < fitted.told < sum(len(u) for u in fitted.deviations)


def test_a_fit_without_changes_has_no_price_and_follows_loose_modes() -> None:
    case = small_case(SOFTER)
    white = white_noise(case)
    held, free = fit_robot(case, (), white), fit_robot(case, (), white, belief=0.01)
    assert held.price == 0.0
    assert held.standard_errors.shape == (0,)
    assert free.misfit < held.misfit
    assert free.deviation > held.deviation
