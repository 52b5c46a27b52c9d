"""Errors of a cause's number that hold its form: between recordings, and with other causes beside it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_model import Change, unnamed_changes

from .robot_fit import RobotFit
from .robot_held_out import Tested
from .robot_search import FreeFit, fit_from, numbered
from .robot_setting import Setting

Real = NDArray[np.float64]


@dataclass(frozen=True)
class NumberErrors:
    """Standard errors of the numbers of a fit, (n_numbers,) each.

    Parameters
    ----------
    fitted
        From noise and the modes' deviations, the causes' form taken to be right.
    spread
        Between fits that leave one recording out: ``sqrt((n - 1) / n sum (theta_i - mean)^2)``, the jackknife (Efron &
        Tibshirani, An Introduction to the Bootstrap, chapter 11).
    form
        Largest shift when one further change is free, weighed by ``1 - exp(-gain / 2)`` of what it gains in cost; the
        masses of bodies are freed too, though none is ever named.
    """

    fitted: Real
    spread: Real
    form: Real

    @property
    def together(self) -> Real:
        """Root of the sum of squares."""
        return np.asarray(np.sqrt(self.fitted**2 + self.spread**2 + self.form**2))


def number_errors(
    setting: Setting, final: RobotFit, elsewhere: Tested, changes: Sequence[Change], free: FreeFit
) -> NumberErrors:
    """Errors of all numbers of a fit.

    Parameters
    ----------
    setting, final
        The fit.
    elsewhere
        Its numbers with one recording left out.
    changes
        All that are weighed.
    free
        Modes and noise as the recordings show them.
    """
    count = len(elsewhere.numbers)
    aside = elsewhere.numbers - elsewhere.numbers.mean(axis=0)
    spread = np.sqrt((count - 1) / count * np.sum(aside**2, axis=0))
    numbers = np.array([number for _, number in final.changes])
    form = np.zeros(len(numbers))
    there = {one.name for one, _ in final.changes}
    for change in (*changes, *unnamed_changes(setting.robot)):
        if change.name in there:
            continue
        fitted = fit_from(setting, (*final.changes, *numbered(change, change.neutral)), free)
        shift = np.abs(np.array([number for _, number in fitted.changes[: len(numbers)]]) - numbers)
        weight = 1 - np.exp(-max(final.cost - fitted.cost, 0.0) / 2)
        form = np.maximum(form, weight * shift)
    return NumberErrors(np.asarray(final.standard_errors), np.asarray(spread), form)
