"""Inputs of the steps: a file by its name, the result of an earlier step, and options that several steps have."""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol, runtime_checkable

from annotated_types import Ge, Gt, Le

from acquisition import RecordingFile
from estimation import Frf, read_frf
from millfrf.core import InputError
from millfrf.core.steps import File, Reads, Typed, Writes, written_file
from millfrf.cutting import MillingProcess
from millfrf.gate import FileKind, check_cutting, check_model, kind_of, read_checked_cutting, stored_warnings
from modal_fit import ModalModel, read_modal_model


@runtime_checkable
class HasFrf(Protocol):
    """Result with an FRF, such as those of ``estimate`` and ``tap``."""

    @property
    def frf(self) -> Frf:
        """The FRF."""


@runtime_checkable
class HasModel(Protocol):
    """Result with a modal model, such as those of ``fit`` and ``calibrate``."""

    @property
    def model(self) -> ModalModel:
        """The modal model."""


@runtime_checkable
class HasImprovement(Protocol):
    """Result of ``diagnose``: its model is the improved one."""

    @property
    def improvement(self) -> object:
        """Errors on held-out data."""


RecordingGiven = Annotated[RecordingFile, Reads("REC")]
FrfGiven = Annotated[File | Frf | HasFrf, Reads("FRF.h5")]
ModelGiven = Annotated[File | ModalModel | HasModel | HasImprovement, Reads("MODEL.json")]
DynamicsGiven = Annotated[File | ModalModel | HasModel | HasImprovement | Frf | HasFrf, Reads("MODEL.json|FRF.h5")]
Figures = Annotated[File | None, Writes("DIR", files=("figure_*",))]
FigureFormat = Literal["svg", "png", "pdf"]
WorkpieceGiven = Annotated[File | ModalModel | HasModel | None, Reads("MODEL.json")]
CutGiven = Annotated[File | MillingProcess, Reads("CUT.toml")]

Robot = Annotated[File, Reads("ROBOT", str)]
Pose = Annotated[str | None, Typed("POSE")]
Joints = Annotated[str | Sequence[float] | None, Typed("V,V,...", str)]
At = Annotated[tuple[float, float, float] | None, Typed("X Y Z"), Ge(-20), Le(20)]
Degrees = Annotated[float, Typed("DEG"), Ge(-1080), Le(1080)]
Turning = Literal["tool", "table"]
Kilograms = Annotated[float, Typed("KG"), Ge(0), Le(10_000)]
NearTip = Annotated[tuple[float, float, float] | None, Typed("X Y Z"), Ge(-5), Le(5)]
Weight = Literal["all", "change", "none"]
Height = Annotated[float, Typed("M"), Ge(-20), Le(20)]
Depth = Annotated[float, Typed("M")]
Variation = Annotated[tuple[float, float], Typed("SHARE TIMES")]
Speed = Annotated[float, Typed("RPM"), Gt(0), Le(1_000_000)]
Poses = Annotated[str | Sequence[str], Typed("POSE", tuple[str, ...])]
Picture = Annotated[File | None, Writes(suffixes=(".png", ".pdf", ".svg"))]
TableFile = Annotated[File | None, Writes(suffixes=(".csv",))]


def frf_of(given: object) -> tuple[Frf, str, list[str]]:
    """An FRF, its name for messages, and the warnings stored in its file."""
    if isinstance(given, str | os.PathLike):
        return read_frf(given), Path(given).name, stored_warnings(given)
    frf = getattr(given, "frf", given)
    if isinstance(frf, Frf):
        return frf, "the FRF", []
    raise InputError(f"a {type(given).__name__} is no FRF; give an FRF, the result of estimate or tap, or a file")


def model_of(given: object) -> tuple[ModalModel, str, list[str]]:
    """A modal model, its name for messages, and the warnings stored in its file."""
    if isinstance(given, str | os.PathLike):
        return read_modal_model(given), Path(given).name, stored_warnings(given)
    if isinstance(given, HasImprovement):
        return _improved(given)
    model = getattr(given, "model", given)
    if isinstance(model, ModalModel):
        return model, "the model", []
    raise InputError(f"a {type(given).__name__} is no modal model; give a model, the result of fit, or a file")


def _improved(given: HasImprovement) -> tuple[ModalModel, str, list[str]]:
    """The improved model of a diagnosis of a structure, its name for messages, and the doubts of the diagnosis."""
    from millfrf.mismatch import Diagnosis, improved_model_of  # not at the top: it takes half a second

    if not isinstance(given, Diagnosis) or given.compared != "structure":
        what = getattr(given, "compared", type(given).__name__)
        raise InputError(f"a diagnosis of a {what} has no modal model; give one of a structure, a model, or a file")
    return improved_model_of(given), "the improved model", list(given.doubts)


def dynamics_of(given: Any) -> tuple[ModalModel | Frf, str, list[str]]:
    """A modal model or an FRF, its name for messages, and the warnings stored in its file."""
    if not isinstance(given, str | os.PathLike):
        return frf_of(given) if isinstance(getattr(given, "frf", given), Frf) else model_of(given)
    kind = kind_of(given)
    if kind not in (FileKind.FRF, FileKind.MODEL):
        raise InputError(f"{given} is a file of {kind}; lobes need a modal model or an FRF at the tool tip")
    return frf_of(given) if kind == FileKind.FRF else model_of(given)


def relative_to(structure: ModalModel | Frf, workpiece: Any) -> tuple[ModalModel | Frf, list[str]]:
    """The tool's structure relative to a workpiece that moves, too, and the warnings stored with the latter."""
    if workpiece is None:
        return structure, []
    if isinstance(structure, Frf):
        raise InputError("a workpiece is added to a modal model of the tool: fit the FRF first (millfrf fit)")
    from millfrf.stability import with_workpiece

    model, name, stored = model_of(workpiece)
    return with_workpiece(structure, model), [*stored, *check_model(model, name)]


def process_of(given: File | MillingProcess) -> tuple[MillingProcess, list[str]]:
    """Milling process and the warnings on it; values that no machine has are refused."""
    if isinstance(given, MillingProcess):
        return given, check_cutting(given)
    return read_checked_cutting(given)


def files_among(*inputs: object) -> list[Path]:
    """Files among the inputs of a step, and those to which a step wrote an input, for its provenance."""
    files = [Path(item) if isinstance(item, str | os.PathLike) else written_file(item) for item in inputs]
    return [file for file in files if file is not None]


def written_input(given: object) -> Path:
    """File of an input: its name, or the file to which a step wrote it."""
    if isinstance(given, str | os.PathLike):
        return Path(given)
    file = written_file(given)
    if file is None:
        kind = type(given).__name__
        raise InputError(
            f"this {kind} is in no file, or its file was changed since: give the step that made it out=FILE, or give "
            "the name of a file"
        )
    return file
