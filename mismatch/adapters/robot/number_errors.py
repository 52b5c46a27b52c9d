"""Errors of a change's number that include its form: between recordings, and with other changes beside it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_model import Change, unnamed_changes

from ...inference import jackknife_variance, shift_weight
from .fit import RobotFit
from .held_out import HeldOutTest
from .posed_robot import PosedRobot
from .start import FreeFit, fit_from, numbered

Real = NDArray[np.float64]


@dataclass(frozen=True)
class NumberErrors:
    """Standard errors of the numbers of a fit, (n_numbers,) each.

    Parameters
    ----------
    fitted
        Errors from noise and the modes' deviations, the form of the causes taken to be right.
    spread
        Spread between fits that leave one recording out, the jackknife.
    form
        Largest shift when one further change is free, weighed by what that change gains in cost; the masses of bodies
        are freed too, though none is ever named.
    """

    fitted: Real
    spread: Real
    form: Real

    @property
    def together(self) -> Real:
        """Root of the sum of squares."""
        return np.asarray(np.sqrt(self.fitted**2 + self.spread**2 + self.form**2))


def number_errors(
    robot: PosedRobot, final: RobotFit, elsewhere: HeldOutTest, changes: Sequence[Change], free: FreeFit
) -> NumberErrors:
    """Errors of all numbers of a fit.

    Parameters
    ----------
    robot
        The robot and its recordings.
    final
        The last fit, with all accepted changes.
    elsewhere
        Test on recordings left out, with the fit's numbers for each.
    changes
        All changes that are weighed.
    free
        Modes and noise as the recordings show them.
    """
    numbers = np.array([number for _, number in final.changes])
    form = np.zeros(len(numbers))
    there = {one.name for one, _ in final.changes}
    for change in (*changes, *unnamed_changes(robot.robot)):
        if change.name in there:
            continue
        fitted = fit_from(robot, (*final.changes, *numbered(change, change.neutral)), free)
        shift = np.abs(np.array([number for _, number in fitted.changes[: len(numbers)]]) - numbers)
        form = np.maximum(form, shift_weight(final.cost - fitted.cost) * shift)
    spread = np.sqrt(jackknife_variance(elsewhere.numbers))
    return NumberErrors(np.asarray(final.standard_errors), np.asarray(spread), form)
