"""Errors of numbers: jackknife and shifts, by fits made by hand."""

from dataclasses import replace

import numpy as np
import pytest
from milled_robots import ROBOT, small_case

from millfrf.mismatch.robot import results as module
from millfrf.mismatch.robot.fit import FreeFit, RobotFit
from millfrf.mismatch.robot.posed import Changes, PosedRobot
from millfrf.mismatch.robot.results import HeldOutTest, NumberErrors, number_errors
from millfrf.robot_model import possible_changes, unnamed_changes

CHANGES = {change.name: change for change in possible_changes(ROBOT)}
JOINT, DAMPING, LINKS = (CHANGES[name] for name in ("joint 3 stiffness", "damping", "links"))
FITTED = RobotFit(((JOINT, 0.7), (DAMPING, 1.5)), (), 500.0, 0.0, 0.0, 10.0, np.array([0.02, 0.1]), (), 30.0)


def test_parts_add_as_squares() -> None:
    parts = NumberErrors(np.array([3.0]), np.array([4.0]), np.array([12.0]))
    assert parts.together == pytest.approx([13.0])


def test_spread_is_the_jackknifes_and_form_the_largest_weighed_shift(monkeypatch: pytest.MonkeyPatch) -> None:
    """Links gain 2 ln 2 and shift the joint by 0.1: half of it counts. Each body gains nothing, whatever it shifts."""
    beside: list[str] = []

    def fitted(robot: PosedRobot, start: Changes, free: FreeFit) -> RobotFit:
        further = start[2][0].name
        beside.append(further)
        shift, gain = (0.1, 2 * np.log(2)) if further == "links" else (0.4, -1.0)
        numbers = ((JOINT, 0.7 + shift), (DAMPING, 1.5 - 0.2 * shift), *start[2:])
        return replace(FITTED, changes=numbers, misfit=500.0 - gain)

    monkeypatch.setattr(module, "fit_from", fitted)
    numbers = np.array([[0.69, 1.4], [0.70, 1.5], [0.74, 1.9]])
    elsewhere = HeldOutTest(numbers, np.zeros(3), np.zeros(3), ())
    result = number_errors(small_case(), FITTED, elsewhere, [JOINT, LINKS], FreeFit(FITTED, ()))
    assert result.fitted == pytest.approx([0.02, 0.1])
    # sqrt((n - 1)^2 / n) times the standard deviation over parts
    assert result.spread == pytest.approx(np.sqrt(4 / 3) * np.std(numbers, axis=0, ddof=1))
    assert result.form == pytest.approx([0.05, 0.01])
    # a change that was accepted is not freed once more, and every body's mass is
    assert beside == ["links", *(each.name for each in unnamed_changes(ROBOT))]
    assert len(beside) > 3
