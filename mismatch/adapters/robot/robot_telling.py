"""From fits and their errors to what is told: causes with numbers, and the table of recordings held out."""

from collections.abc import Sequence

import numpy as np

from robot_model import Change, Companion

from .robot_errors import NumberErrors
from .robot_fit import RobotFit
from .robot_held_out import Tested
from .robot_results import Beside, HeldOut, RobotCause


def fit_errors(fitted: RobotFit) -> NumberErrors:
    """Errors of a candidate: those of its fit alone."""
    nothing = np.zeros(len(fitted.changes))
    return NumberErrors(np.asarray(fitted.standard_errors), nothing, nothing)


def told_causes(fitted: RobotFit, errors: NumberErrors, evidence: dict[str, float]) -> tuple[RobotCause, ...]:
    """Every change of a fit with its number, errors and companions.

    Parameters
    ----------
    fitted
        The fit.
    errors
        Of its numbers.
    evidence
        By the change's name.
    """
    causes = []
    for place, (change, number) in enumerate(fitted.changes):
        if not isinstance(change, Change):
            continue
        beside = tuple(
            Beside(one.name, one.unit, value, float(errors.together[at]), one.spread)
            for at, (one, value) in enumerate(fitted.changes)
            if isinstance(one, Companion) and one in change.companions
        )
        parts = (float(part[place]) for part in (errors.together, errors.fitted, errors.spread, errors.form))
        whole, own, spread, form = parts
        causes.append(
            RobotCause(
                change.name, change.kind, change.unit, number, whole, evidence[change.name], own, spread, form, beside
            )
        )
    return tuple(causes)


def held_out_table(names: Sequence[str], before: Tested, after: Tested) -> tuple[HeldOut, ...]:
    """One row for each recording that was left out."""
    rows = zip(names, before.errors, after.errors, before.floors, strict=True)
    return tuple(HeldOut(name, float(one), float(other), float(floor)) for name, one, other, floor in rows)
