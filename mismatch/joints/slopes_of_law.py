"""Derivative of a joint's law by its numbers, in the form of the law: tables, springs and yields."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .joint_law import JointLaw

Real = NDArray[np.float64]
Columns = NDArray[np.float32]


@dataclass(frozen=True)
class LawSlopes:
    """How the force of a law changes with each of its numbers, for a motion that is given.

    A law is linear in its tables and springs, so that their changes make up that of the force; what a yield changes
    is a force wherever the element slipped last. No law has to be followed along a motion twice.

    Parameters
    ----------
    stiffness, damping : (n_points, n_numbers), N by a number's coordinate
        Change of the law's tables, at their points; no rows where no number changes a table.
    ramp : (2, n_numbers), N/m by a coordinate
        Change of the stiffness's change with time, and of its bend.
    springs : (n_elements, n_numbers), N/m by a coordinate
        Change of the elements' springs.
    yields : (n_elements, n_numbers), N by a coordinate
        Change of the force of each element that has yielded, from its yield alone.
    """

    stiffness: Columns
    damping: Columns
    ramp: Columns
    springs: Columns
    yields: Columns

    @property
    def parts(self) -> tuple[tuple[Columns, Columns], Columns, tuple[Columns, Columns]]:
        """Tables, ramp and elements, as the compiled loops take them."""
        return (self.stiffness, self.damping), self.ramp, (self.springs, self.yields)


def law_slopes(law: JointLaw, changes: Sequence[JointLaw]) -> LawSlopes:
    """Derivative of a law as the compiled loops take it.

    Parameters
    ----------
    law
        The law at which the derivative is taken.
    changes
        For each number, what the law changes by a unit of the number's coordinate: tables over the same spans as the
        law's, or none; the law's elements, with the change of their springs and yields.
    """
    ramp = [[change.ramp for change in changes], [change.bend for change in changes]]
    springs, yields = (
        [getattr(change, name) for change in changes] if len(law.springs) else np.zeros((len(changes), 0))
        for name in ("springs", "yields")
    )
    return LawSlopes(
        _by_number([change.stiffness for change in changes]),
        _by_number([change.damping for change in changes]),
        np.array(ramp, dtype=np.float32),
        np.array(springs, dtype=np.float32).T.copy(),
        (np.array(yields).T * law.springs[:, None]).astype(np.float32),
    )


def law_quotient(law: JointLaw, aside: JointLaw, step: float) -> JointLaw:
    """Difference quotient of two laws, on the spans of the first.

    Parameters
    ----------
    law, aside
        The law, and the law with a coordinate a step aside; both have the same elements.
    step
        Length of that step, in the coordinate's unit of a fit.
    """
    return JointLaw(
        law.reach,
        _table_quotient((law.stiffness, law.reach), (aside.stiffness, aside.reach), step),
        law.speed,
        _table_quotient((law.damping, law.speed), (aside.damping, aside.speed), step),
        (aside.ramp - law.ramp) / step,
        (aside.bend - law.bend) / step,
        (aside.springs - law.springs) / step,
        (aside.yields - law.yields) / step,
    )


def _table_quotient(here: tuple[Real, float], aside: tuple[Real, float], step: float) -> Real:
    """Difference quotient of two tables, each with the end of its axis; empty where they are the same."""
    table, end = here
    other, far = aside
    if np.array_equal(table, other) and end == far:
        return np.zeros(0)
    if len(other) != len(table) or far != end:
        other = np.interp(np.linspace(-end, end, len(table)), np.linspace(-far, far, len(other)), other)
    return np.asarray((other - table) / step)


def _by_number(tables: Sequence[Real]) -> Columns:
    """Tables side by side, (n_points, n_numbers), zeros for those that are empty; no rows where all are."""
    points = max((len(table) for table in tables), default=0)
    result = np.zeros((points, len(tables)), dtype=np.float32)
    for k, table in enumerate(tables):
        if len(table):
            result[:, k] = table
    return result
