"""What a user hands to a step: a file by its name, or what an earlier step returned."""

import os
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

from acquisition import RecordingFile
from estimation import Frf, read_frf
from millfrf.core import InputError
from millfrf.core.steps import File, Reads, Writes
from millfrf.cutting import MillingProcess
from millfrf.gate import FileKind, check_cutting, kind_of, read_checked_cutting, stored_doubts
from modal_fit import ModalModel, read_modal_model


class HasFrf(Protocol):
    """What ``estimate`` and ``tap`` return: an FRF with the evidence for it."""

    @property
    def frf(self) -> Frf:
        """The FRF."""


class HasModel(Protocol):
    """What ``fit`` and ``calibrate`` return: a modal model with the evidence for it."""

    @property
    def model(self) -> ModalModel:
        """The modal model."""


RecordingGiven = Annotated[RecordingFile, Reads("REC")]
FrfGiven = Annotated[File | Frf | HasFrf, Reads("FRF.h5")]
ModelGiven = Annotated[File | ModalModel | HasModel, Reads("MODEL.json")]
DynamicsGiven = Annotated[File | ModalModel | HasModel | Frf | HasFrf, Reads("MODEL.json|FRF.h5")]
Figures = Annotated[File | None, Writes("DIR", files=("figure_*",))]
FigureFormat = Literal["svg", "png", "pdf"]
CutGiven = Annotated[File | MillingProcess, Reads("CUT.toml")]


def frf_of(given: object) -> tuple[Frf, str, list[str]]:
    """An FRF, its name for messages, and the doubts that its file states.

    Raises
    ------
    InputError
        Something that is neither an FRF nor a file of one.
    """
    if isinstance(given, str | os.PathLike):
        return read_frf(given), Path(given).name, stored_doubts(given)
    held = getattr(given, "frf", given)
    if isinstance(held, Frf):
        return held, "the FRF", []
    raise InputError(f"a {type(given).__name__} is no FRF; give an FRF, what estimate or tap returned, or a file")


def model_of(given: object) -> tuple[ModalModel, str, list[str]]:
    """A modal model, its name for messages, and the doubts that its file states.

    Raises
    ------
    InputError
        Something that is neither a modal model nor a file of one.
    """
    if isinstance(given, str | os.PathLike):
        return read_modal_model(given), Path(given).name, stored_doubts(given)
    held = getattr(given, "model", given)
    if isinstance(held, ModalModel):
        return held, "the model", []
    raise InputError(f"a {type(given).__name__} is no modal model; give a model, what fit returned, or a file")


def dynamics_of(given: Any) -> tuple[ModalModel | Frf, str, list[str]]:
    """A modal model or an FRF, its name for messages, and the doubts that its file states.

    Raises
    ------
    InputError
        Something that is neither of the two.
    """
    if not isinstance(given, str | os.PathLike):
        return frf_of(given) if isinstance(getattr(given, "frf", given), Frf) else model_of(given)
    kind = kind_of(given)
    if kind not in (FileKind.FRF, FileKind.MODEL):
        raise InputError(f"{given} is a file of {kind}; lobes need a modal model or an FRF at the tool tip")
    return frf_of(given) if kind == FileKind.FRF else model_of(given)


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


def files_among(*given: object) -> list[Path]:
    """Names of files among what was handed to a step, for its provenance."""
    return [Path(item) for item in given if isinstance(item, str | os.PathLike)]
