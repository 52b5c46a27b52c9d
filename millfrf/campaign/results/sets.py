"""Results of one set: its files, read, and its rows of the table of modes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

import numpy as np

from millfrf.core import InputError, Real
from millfrf.gate import check_model, doubts_of, stored_doubts
from millfrf.mismatch import read_diagnosis
from millfrf.stability import StabilityLobes, read_lobes
from modal_fit import ModalModel, read_modal_model

POSE, POSTURE = "pose", "posture_deg"
"""Labels with a meaning of their own: the name of the pose, and its joint angles."""

NOT_STATED = "not stated"
"""Pose of sets that state neither pose nor posture: they are taken to be in one."""


@dataclass(frozen=True)
class MeasuredSet:
    """Recordings that were stacked to one FRF, and where their results are.

    Parameters
    ----------
    name
        Name of the set, such as ``P07 session=2``; no two sets of a campaign share one.
    labels
        Labels that its recordings share, text or numbers; a number that differs among them stands as its mean.
    posture : (n_active,), rad or m
        Driven joint values, or None where the posture is not known.
    recorded_at : s
        Mean time of its recordings since 1970, or None.
    recordings
        Names of the recordings' files.
    model
        Modal model at the tool tip, JSON; None: there is none.
    lobes
        Lobes of that model, CSV; None: there are none.
    diagnosis
        Diagnosis of the set, JSON; None: there is none.
    failures
        One line for each step that failed.
    """

    name: str
    labels: Mapping[str, str | float]
    posture: tuple[float, ...] | None
    recorded_at: float | None
    recordings: tuple[str, ...]
    model: Path | None
    lobes: Path | None
    diagnosis: Path | None
    failures: tuple[str, ...]

    @property
    def pose(self) -> str:
        """Name of the pose; of a set without that label its joint values, or ``NOT_STATED``."""
        named = self.labels.get(POSE)
        if named is not None:
            return str(named)
        if self.posture is not None:
            return "(" + ", ".join(f"{value:.4g}" for value in self.posture) + ")"
        return NOT_STATED


Read = TypeVar("Read")


@dataclass(frozen=True)
class LowestLimit:
    """Lowest depth limit of a set over its spindle speeds.

    Parameters
    ----------
    depth : m
        Lowest limit; infinite where no speed has one.
    speed_rpm
        Spindle speed of the lowest limit, revolutions a minute; NaN where no speed has a limit.
    status
        Worth of the limit, as the table of lobes states it.
    """

    depth: float
    speed_rpm: float
    status: str


@dataclass(frozen=True)
class SetResults:
    """A set with its modal model, lowest limit and verdict.

    Parameters
    ----------
    measured
        The set and its labels.
    model
        Modal model, or None.
    limit
        Lowest depth limit, or None.
    verdict
        Verdict of the diagnosis; empty: not diagnosed.
    doubts
        Sentences that a reader should know before trusting the set.
    failures
        One line for each step that failed, and for each file that cannot be read.
    """

    measured: MeasuredSet
    model: ModalModel | None
    limit: LowestLimit | None
    verdict: str
    doubts: tuple[str, ...]
    failures: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the set, as the campaign gives it."""
        return self.measured.name

    @property
    def errors(self) -> tuple[Real, Real]:
        """Standard errors of natural frequencies (Hz) and of damping ratios, each (n_modes,); NaN: not known."""
        if self.model is None:
            return np.zeros(0), np.zeros(0)
        known = self.model.standard_errors()
        unknown = np.full(len(self.model.poles), np.nan)
        return (unknown, unknown) if known is None else known


def read_set(measured: MeasuredSet) -> SetResults:
    """Read what the jobs wrote of a set.

    Parameters
    ----------
    measured
        The set, with the places of its files.
    """
    failures: list[str] = list(measured.failures)
    model = _read(measured.model, read_modal_model, failures)
    lobes = _read(measured.lobes, read_lobes, failures)
    diagnosis = _read(measured.diagnosis, read_diagnosis, failures)
    doubts: list[str] = []
    if model is not None and measured.model is not None:
        doubts += [*stored_doubts(measured.model), *doubts_of(check_model, model, "modal model")]
        if not len(model.poles):
            failures.append("the modal model has no modes")
    doubts += [] if lobes is None else [*lobes.warnings]
    doubts += [] if diagnosis is None else [*diagnosis.doubts]
    return SetResults(
        measured,
        model if model is not None and len(model.poles) else None,
        None if lobes is None else lowest_limit(lobes),
        "" if diagnosis is None else diagnosis.verdict,
        tuple(dict.fromkeys(" ".join(doubt.split()) for doubt in doubts)),
        tuple(failures),
    )


def lowest_limit(lobes: StabilityLobes) -> LowestLimit | None:
    """Lowest depth limit and its spindle speed; None where no speed is resolved.

    Parameters
    ----------
    lobes
        Limits over spindle speed.
    """
    known = ~np.isnan(lobes.depth_limits)
    if not known.any():
        return None
    least = int(np.argmin(np.where(known, lobes.depth_limits, np.inf)))
    if not np.isfinite(lobes.depth_limits[least]):
        return LowestLimit(np.inf, np.nan, "no limit")
    return LowestLimit(
        float(lobes.depth_limits[least]), float(lobes.spindle_speeds_rpm[least]), str(lobes.status[least])
    )


def _read(path: Path | None, reader: Callable[[Path], Read], failures: list[str]) -> Read | None:
    if path is None:
        return None
    try:
        return reader(path)
    except InputError as error:
        failures.append(str(error))
        return None


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
