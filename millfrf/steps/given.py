"""What a user hands to a function: a file by its name, or what an earlier function returned."""

import os
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path

from acquisition import Recording, Stream
from estimation import Frf, read_frf
from millfrf.core import InputError, MillfrfWarning
from millfrf.core.file_kinds import FRF, MODEL, kind_of
from millfrf.cutting import MillingProcess
from millfrf.gate import check_cutting, read_checked_cutting, stored_doubts
from modal_fit import ModalFit, ModalModel, SubspaceFit, TipCalibration, read_modal_model

from .tap import TapResult
from .test_spectra import Estimate

File = str | os.PathLike[str]
GivenRecording = File | Recording
GivenFrf = File | Frf | Estimate | TapResult
GivenModel = File | ModalModel | ModalFit | SubspaceFit | TipCalibration

HIGHEST_LEVEL = 3
"""Frames between a warning and the line of the user: this module's function, and the function that was called."""


def warn_of(doubts: Iterable[str]) -> None:
    """Give each doubt once as a :class:`millfrf.core.MillfrfWarning` at the line that called the face."""
    for doubt in dict.fromkeys(doubts):
        warnings.warn(doubt, MillfrfWarning, stacklevel=HIGHEST_LEVEL)


def files_of(recordings: Iterable[object]) -> list[Path]:
    """Names of recording files; of a recording that is open, the name of its file.

    Raises
    ------
    InputError
        Something that is neither a name nor a recording.
    """
    return [_file_of(one) for one in recordings]


def _file_of(given: object) -> Path:
    if isinstance(given, Recording | Stream):
        return given.path
    if isinstance(given, str | os.PathLike):
        return Path(given)
    raise InputError(f"a {type(given).__name__} is no recording; give a recording or the name of its file")


def frf_of(given: object) -> tuple[Frf, str, list[str]]:
    """An FRF, its name for messages, and the doubts that its file states.

    Raises
    ------
    InputError
        Something that is neither an FRF nor a file of one.
    """
    if isinstance(given, Frf):
        return given, "the FRF", []
    if isinstance(given, Estimate | TapResult):
        return given.frf, "the FRF", []
    if isinstance(given, str | os.PathLike):
        return read_frf(given), Path(given).name, stored_doubts(given)
    raise InputError(f"a {type(given).__name__} is no FRF; give an FRF, what estimate or tap returned, or a file")


def model_of(given: object) -> tuple[ModalModel, str, list[str]]:
    """A modal model, its name for messages, and the doubts that its file states.

    Raises
    ------
    InputError
        Something that is neither a modal model nor a file of one.
    """
    if isinstance(given, ModalModel):
        return given, "the model", []
    if isinstance(given, ModalFit | SubspaceFit | TipCalibration):
        return given.model, "the model", []
    if isinstance(given, str | os.PathLike):
        return read_modal_model(given), Path(given).name, stored_doubts(given)
    raise InputError(f"a {type(given).__name__} is no modal model; give a model, what fit returned, or a file")


def dynamics_of(given: GivenModel | GivenFrf) -> tuple[ModalModel | Frf, str, list[str]]:
    """A modal model or an FRF, its name for messages, and the doubts that its file states.

    Raises
    ------
    InputError
        Something that is neither of the two.
    """
    if isinstance(given, Frf | Estimate | TapResult):
        return frf_of(given)
    if not isinstance(given, str | os.PathLike):
        return model_of(given)
    kind = kind_of(given)
    if kind not in (FRF, MODEL):
        raise InputError(f"{given} is a file of {kind}; lobes need a modal model or an FRF at the tool tip")
    return frf_of(given) if kind == FRF else model_of(given)


def process_of(given: File | MillingProcess) -> tuple[MillingProcess, list[str]]:
    """A cut that the gate has judged, and its doubts.

    Raises
    ------
    InputError
        A file that cannot be read, or a value that no machine has.
    """
    if isinstance(given, MillingProcess):
        return given, check_cutting(given)
    return read_checked_cutting(given)


def names_of(given: str | Sequence[str]) -> tuple[str, ...]:
    """Channel names: one, or several."""
    return (given,) if isinstance(given, str) else tuple(given)
