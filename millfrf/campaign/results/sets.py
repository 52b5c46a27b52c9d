"""Results of one set of recordings, and its rows in the table of modes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TypeVar

import numpy as np

from millfrf.core import InputError, Real
from millfrf.gate import check_model, stored_warnings, warnings_of
from millfrf.mismatch import read_diagnosis
from millfrf.stability import StabilityLobes, read_lobes
from modal_fit import ModalModel, read_modal_model

POSE, POSTURE = "pose", "posture_deg"  # labels of the pose and of its joint angles
NOT_STATED = "not stated"  # pose of sets without pose and posture; they share a pose


@dataclass(frozen=True)
class MeasuredSet:
    """Recordings that were averaged to one FRF, and the files of their results."""

    name: str  # unique, such as ``P07 session=2``
    labels: Mapping[str, str | float]  # common labels; numbers that differ are averaged
    posture: tuple[float, ...] | None  # (n_active,), rad or m; driven joint values
    recorded_at: float | None  # s since 1970; mean of the recordings
    recordings: tuple[str, ...]  # names of files
    model: Path | None  # modal model at the tool tip, JSON
    lobes: Path | None  # lobes of that model, CSV
    diagnosis: Path | None  # JSON
    failures: tuple[str, ...]  # one line for each step that failed

    @property
    def pose(self) -> str:
        """Name of the pose, else the joint values, else ``NOT_STATED``."""
        named = self.labels.get(POSE)
        if named is not None:
            return str(named)
        if self.posture is not None:
            return "(" + ", ".join(f"{value:.4g}" for value in self.posture) + ")"
        return NOT_STATED


Read = TypeVar("Read")


@dataclass(frozen=True)
class LowestLimit:
    """Lowest depth limit of a set over its spindle speeds."""

    depth: float  # m; infinite: no speed has a limit
    speed_rpm: float  # NaN: no speed has a limit
    status: str  # as in the table of lobes


@dataclass(frozen=True)
class SetResults:
    """A set with its modal model, lowest depth limit and verdict of the diagnosis."""

    measured: MeasuredSet
    model: ModalModel | None
    limit: LowestLimit | None
    verdict: str  # empty: not diagnosed
    doubts: tuple[str, ...]  # warnings, one sentence each
    failures: tuple[str, ...]  # one line for each step that failed, and for each file that cannot be read

    @property
    def name(self) -> str:
        return self.measured.name

    @property
    def errors(self) -> tuple[Real, Real]:
        """Standard errors of natural frequencies (Hz) and of damping ratios, one for each mode; NaN if unknown."""
        if self.model is None:
            return np.zeros(0), np.zeros(0)
        known = self.model.standard_errors()
        unknown = np.full(len(self.model.poles), np.nan)
        return (unknown, unknown) if known is None else known


def read_set(measured: MeasuredSet) -> SetResults:
    """Read the results of a set; a file that cannot be read is a failure of the set."""
    failures: list[str] = list(measured.failures)
    model = _read(measured.model, read_modal_model, failures)
    lobes = _read(measured.lobes, read_lobes, failures)
    diagnosis = _read(measured.diagnosis, read_diagnosis, failures)
    doubts: list[str] = []
    if model is not None and measured.model is not None:
        doubts += [*stored_warnings(measured.model), *warnings_of(check_model, model, "modal model")]
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
    """Return the lowest depth limit and its spindle speed; None if no speed is resolved."""
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
    """Identity of a mode of one set among the modes of the campaign."""

    number: int  # from 1; equal numbers in several sets are the same mode
    likeness: float  # MAC with the mean shape of the mode in its pose; NaN: fewer than two common points
    doubt: str = ""  # why the identity is uncertain; empty: certain


Names = Mapping[tuple[str, int], ModeName]  # by set and number in the model of the set, from 0


def mode_rows(sets: Sequence[SetResults], names: Names, places: Mapping[str, Real]) -> list[dict[str, Cell]]:
    """Return one row for each mode of each set; all rows have the same columns.

    ``places`` contains the position x, y, z (m) of the tool tip in the base frame by name of the set.
    """
    labels = list(dict.fromkeys(name for results in sets for name in results.measured.labels if name != "pose"))
    joints = max((len(results.measured.posture or ()) for results in sets), default=0)
    return [row for results in sets for row in _rows_of(results, labels, joints, names, places.get(results.name))]


def _rows_of(
    results: SetResults, labels: Sequence[str], joints: int, names: Names, place: Real | None
) -> list[dict[str, Cell]]:
    start = _of_set(results, labels, joints, place)
    end: dict[str, Cell] = {
        "depth_limit_m": None if results.limit is None else results.limit.depth,
        "depth_limit_speed_rpm": None if results.limit is None else results.limit.speed_rpm,
        "depth_limit_status": "" if results.limit is None else results.limit.status,
        "verdict": results.verdict,
        "recordings": "; ".join(results.measured.recordings),
        "doubts": "; ".join(results.doubts),
        "failures": "; ".join(results.failures),
    }
    if results.model is None:
        return [start | _of_mode(None, None, None) | end]
    frequency, damping = results.model.natural_frequencies, results.model.damping_ratios
    values = np.stack([frequency, results.errors[0], damping, results.errors[1]], axis=1)
    return [start | _of_mode(i, values[i], names.get((results.name, i))) | end for i in range(len(values))]


def _of_set(results: SetResults, labels: Sequence[str], joints: int, place: Real | None) -> dict[str, Cell]:
    measured = results.measured
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
    """Format a time in seconds since 1970 as ISO 8601 in UTC.

    Examples
    --------
    >>> as_utc(1_700_000_000.0)
    '2023-11-14T22:13:20Z'
    """
    return datetime.fromtimestamp(round(seconds), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
