"""Labels as regressors: numbers that vary inside poses, time among them, and text as groups."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..measured_set import POSE, POSTURE, MeasuredSet

Real = NDArray[np.float64]

TIME = "time"
"""Name of the time of recording as a label, in days since the first set."""

DAY = 86400.0

_DIGITS = re.compile(r"-?\d+(\.\d+)?", re.ASCII)

MOST_GROUPS = 6
"""Values of a text that still count as groups; a text with more is a remark."""


@dataclass(frozen=True)
class Labels:
    """Labels of all sets as columns.

    Parameters
    ----------
    numbers : (n_sets,)
        Values of each label that holds numbers and varies inside a pose, by its name; NaN where a set lacks it.
    texts
        Values of each label that holds text and varies inside a pose, by its name.
    notes
        Sentences on labels that were left out or taken for another.
    """

    numbers: Mapping[str, Real]
    texts: Mapping[str, tuple[str, ...]]
    notes: tuple[str, ...] = ()


def labels_of(sets: Sequence[MeasuredSet]) -> Labels:
    """Sort the labels of a campaign into numbers and groups.

    A label counts as a number where each of its values is one or a text of digits: session ``07`` comes after ``06``,
    though it stays text in names of files and sets. A note says so. Other texts that Python could read as numbers
    (``nan``, ``1e5``, ``1_0``) are texts.

    Parameters
    ----------
    sets
        Sets of the campaign.
    """
    poses = np.array([one.pose for one in sets])
    numbers: dict[str, Real] = {}
    texts: dict[str, tuple[str, ...]] = {}
    notes: list[str] = []
    names = dict.fromkeys(name for one in sets for name in one.labels if name not in (POSE, POSTURE))
    for name in names:
        values = [one.labels.get(name) for one in sets]
        column = _as_numbers(values)
        if column is not None:
            numbers[name] = column
            if any(isinstance(value, str) for value in values):
                notes.append(f"label {name} is text of digits, such as {_first_text(values)}: it is taken for a number")
        elif len(set(values)) <= MOST_GROUPS:
            texts[name] = tuple("" if value is None else str(value) for value in values)
        else:
            notes.append(f"label {name} is a text of {len(set(values))} values: it is not looked at")
    times = np.array([np.nan if one.recorded_at is None else one.recorded_at for one in sets])
    if np.isfinite(times).any():
        numbers[TIME] = (times - np.nanmin(times)) / DAY
    numbers = {name: column for name, column in numbers.items() if _varies(column, poses)}
    same = _in_order_of_time(numbers, poses)
    if same:
        numbers.pop(TIME)
        notes.append(f"{same} rises with the time of recording in every pose: a trend over {same} is one over time")
    texts = {name: column for name, column in texts.items() if _varies(_codes(column), poses)}
    return Labels(numbers, texts, tuple(notes))


def dummies(texts: Mapping[str, tuple[str, ...]], rows: Sequence[int]) -> Real:
    """Columns 0 and 1 for the groups of chosen rows, one less than there are groups in each label.

    Parameters
    ----------
    texts
        Labels of text, see :class:`Labels`.
    rows
        Numbers of the chosen sets.
    """
    columns = [
        [float(column[row] == value) for row in rows]
        for column in texts.values()
        for value in sorted({column[row] for row in rows})[1:]
    ]
    return np.array(columns, dtype=float).reshape(len(columns), len(rows)).T


def _as_numbers(values: Sequence[str | float | None]) -> Real | None:
    """A column of numbers; None where a value spells none."""
    if any(isinstance(value, str) and _DIGITS.fullmatch(value) is None for value in values):
        return None
    column = np.array([np.nan if value is None else float(value) for value in values])
    return column if np.isfinite(column).any() else None


def _first_text(values: Sequence[str | float | None]) -> str:
    return next(value for value in values if isinstance(value, str))


def _codes(column: tuple[str, ...]) -> Real:
    order = sorted(set(column))
    return np.array([float(order.index(value)) for value in column])


def _varies(column: Real, poses: NDArray[np.str_]) -> bool:
    """Whether it has two values in some pose."""
    return any(len(np.unique(column[(poses == pose) & np.isfinite(column)])) > 1 for pose in np.unique(poses))


def _in_order_of_time(numbers: Mapping[str, Real], poses: NDArray[np.str_]) -> str:
    """Name of the label that counts time, such as a session: whole numbers that never fall while time rises."""
    if TIME not in numbers:
        return ""
    for name in sorted(numbers):
        column = numbers[name]
        if (
            name != TIME
            and _counts(column)
            and all(_rises(column, numbers[TIME], poses == p) for p in np.unique(poses))
        ):
            return name
    return ""


def _counts(column: Real) -> bool:
    known = column[np.isfinite(column)]
    return bool(np.all(known == np.round(known)) and len(known) == len(column))


def _rises(column: Real, time: Real, chosen: NDArray[np.bool_]) -> bool:
    order = np.argsort(time[chosen], kind="stable")
    return bool(np.all(np.isfinite(time[chosen])) and np.all(np.diff(column[chosen][order]) >= 0))
