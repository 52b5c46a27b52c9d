"""`SetResults`: the files of a set, read; a file that cannot be used is a failure of the set, in one line."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError
from millfrf.mismatch import read_diagnosis
from millfrf.stability import StabilityLobes, read_lobes
from modal_fit import ModalModel, read_modal_model

from ...gate import check_model, doubts_of, stored_doubts
from .measured_set import MeasuredSet

Real = NDArray[np.float64]
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
