"""The fit against all its neighbours, and against the number that was concealed."""

import numpy as np
import pytest
from milled_robots import ROBOT, cost_at, shifted, small_case, white_noise

from millfrf.mismatch import predicted_spectrum
from millfrf.mismatch.robot.fit import FitProblem, fit_robot, numbered
from millfrf.robot_model import Companion, SpatialRobot, possible_changes, with_joint_factor, with_payload

CHANGES = {change.name: change for change in possible_changes(ROBOT)}
PAYLOAD = with_payload(ROBOT, 12.0)
SOFTER = with_joint_factor(ROBOT, "3", 0.7)


@pytest.mark.parametrize(
    ("truth", "name", "number", "first"),
    [(SOFTER, "joint 3 stiffness", 0.7, 0.8), (PAYLOAD, "payload", 12.0, 8.0)],
    ids=["joint 3", "payload"],
)
def test_a_fit_ends_at_the_number_and_below_all_its_neighbours(
    truth: SpatialRobot, name: str, number: float, first: float
) -> None:
    case = small_case(truth)
    white = white_noise(case)
    start = numbered(CHANGES[name], first)
    fitted = fit_robot(case, start, white)
    assert abs(fitted.changes[0][1] - number) < 3 * fitted.standard_errors[0]
    spectrum, u, seen = case.recordings[0].spectrum, fitted.deviations[0], fitted.modes[0]
    rest = np.einsum("kij,kj->ki", white[0], spectrum.measured - predicted_spectrum(seen, spectrum))
    assert fitted.misfit == pytest.approx(2 * np.sum(np.abs(rest) ** 2), rel=1e-9)
    assert fitted.cost == pytest.approx(cost_at(case, fitted.changes, white, u, seen), rel=1e-9)
    assert fitted.cost < FitProblem(case, tuple(white)).state(start).cost
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
    for (each, number), error in rows:
        if isinstance(each, Companion):
            price += max(2 * np.log(each.spread / error), 0.0)
            doubt += ((number - each.centre) / each.spread) ** 2
    assert len(rows) == 1 + len(CHANGES["payload"].companions) > 1
    assert fitted.price == pytest.approx(price)
    assert fitted.companion_prior == pytest.approx(doubt)
    assert fitted.deviation == pytest.approx(sum(u @ u for u in fitted.deviations))
    assert fitted.score == pytest.approx(fitted.misfit + fitted.deviation + doubt + price)
    assert 0 < fitted.determined < sum(len(u) for u in fitted.deviations)


def test_a_fit_without_changes_has_no_price_and_follows_loose_modes() -> None:
    case = small_case(SOFTER)
    white = white_noise(case)
    held, free = fit_robot(case, (), white), fit_robot(case, (), white, precision=0.01)
    assert held.price == 0.0
    assert held.standard_errors.shape == (0,)
    assert free.misfit < held.misfit
    assert free.deviation > held.deviation
