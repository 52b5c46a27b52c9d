"""Rows of the table of modes: a row a mode of each set, and a row without a mode for a set that has none."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
from numpy.typing import NDArray

from ..read_set import SetResults

Real = NDArray[np.float64]
Cell = str | float | int | None


@dataclass(frozen=True)
class ModeName:
    """Which mode of the campaign a mode of one set is.

    Parameters
    ----------
    number
        Number of the mode in the campaign, from 1; modes of several sets with one number are the same mode.
    likeness
        Modal assurance criterion with the mode's mean shape in its pose; NaN where shapes cannot be compared.
    doubt
        Why it may be another mode; empty: no doubt.
    """

    number: int
    likeness: float
    doubt: str = ""


Names = Mapping[tuple[str, int], ModeName]
"""Name of each mode by its set and its number in the set's model, from 0."""


def mode_rows(sets: Sequence[SetResults], names: Names, places: Mapping[str, Real]) -> list[dict[str, Cell]]:
    """Make the rows in the order of sets and modes; every row has the same columns, with units in their names.

    Parameters
    ----------
    sets
        Sets of the campaign, as read.
    names
        Which mode of the campaign each mode is; a mode that is missing there could not be told.
    places : (3,), m
        Position of the tool tip in the base frame by the name of the set.
    """
    labels = list(dict.fromkeys(name for one in sets for name in one.measured.labels if name != "pose"))
    joints = max((len(one.measured.posture or ()) for one in sets), default=0)
    return [row for one in sets for row in _rows_of(one, labels, joints, names, places.get(one.name))]


def _rows_of(
    one: SetResults, labels: Sequence[str], joints: int, names: Names, place: Real | None
) -> list[dict[str, Cell]]:
    start = _of_set(one, labels, joints, place)
    end: dict[str, Cell] = {
        "depth_limit_m": None if one.limit is None else one.limit.depth,
        "depth_limit_speed_rpm": None if one.limit is None else one.limit.speed_rpm,
        "depth_limit_status": "" if one.limit is None else one.limit.status,
        "verdict": one.verdict,
        "recordings": "; ".join(one.measured.recordings),
        "doubts": "; ".join(one.doubts),
        "failures": "; ".join(one.failures),
    }
    if one.model is None:
        return [start | _of_mode(None, None, None) | end]
    frequency, damping = one.model.natural_frequencies, one.model.damping_ratios
    values = np.stack([frequency, one.errors[0], damping, one.errors[1]], axis=1)
    return [start | _of_mode(i, values[i], names.get((one.name, i))) | end for i in range(len(values))]


def _of_set(one: SetResults, labels: Sequence[str], joints: int, place: Real | None) -> dict[str, Cell]:
    measured = one.measured
    posture = measured.posture or ()
    row: dict[str, Cell] = {"set": measured.name, "pose": measured.pose}
    row |= {f"label_{name}": measured.labels.get(name) for name in labels}
    row |= {f"joint_{k + 1}_rad_or_m": posture[k] if k < len(posture) else None for k in range(joints)}
    row |= {f"tip_{axis}_m": None if place is None else float(place[k]) for k, axis in enumerate("xyz")}
    row["recorded_at"] = "" if measured.recorded_at is None else as_utc(measured.recorded_at)
    return row


def _of_mode(index: int | None, values: Real | None, name: ModeName | None) -> dict[str, Cell]:
    frequency, frequency_error, damping, damping_error = [None] * 4 if values is None else [float(x) for x in values]
    return {
        "mode_of_set": None if index is None else index + 1,
        "mode": None if name is None else name.number,
        "mode_likeness": None if name is None else name.likeness,
        "mode_doubt": "" if name is None else name.doubt,
        "frequency_hz": frequency,
        "frequency_standard_error_hz": frequency_error,
        "damping_ratio": damping,
        "damping_ratio_standard_error": damping_error,
    }


def as_utc(seconds: float) -> str:
    """A time in seconds since 1970 as ISO 8601 in UTC, to the second.

    Examples
    --------
    >>> as_utc(1_700_000_000.0)
    '2023-11-14T22:13:20Z'
    """
    return datetime.fromtimestamp(round(seconds), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
