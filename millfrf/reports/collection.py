"""Files of a report, and their relations to each other."""

import gc
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acquisition import Recording
from estimation import Frf, Geometry, read_frf, read_geometry
from millfrf.core import InputError, is_side_file
from millfrf.core.provenance import read_provenance, sha256
from millfrf.cutting import MillingProcess
from millfrf.gate import FileKind, ReportFile, check_belonging, cutting_provenance, kind_of, read_checked_cutting
from millfrf.stability import KeptCut, StabilityLobes, read_cuts, read_lobes
from modal_fit import ModalModel, read_modal_model


@dataclass(frozen=True)
class SourceFile:
    """A file of the report, with the sources and versions that it states."""

    path: Path
    kind: str
    sha256: str
    provenance: dict[str, Any]

    @property
    def label(self) -> str:
        """File name without suffix and kind, with spaces for underscores."""
        return self.path.stem.replace("_", " ").removeprefix("lobes ")

    def made_from(self, other: "SourceFile") -> bool:
        """Return whether this file was made from the exact content of the file ``other``."""
        return any(source.get("sha256") == other.sha256 for source in self.provenance.get("sources", []))


@dataclass(frozen=True)
class Collected:
    """All files of a report, read (recordings stay on disk).

    Parameters
    ----------
    files
        All files, in the order of the command line.
    recordings, frfs, models, lobes, cutting, chatter
        Contents by kind, each with its file.
    geometries
        Positions of the points, each with its file.
    doubts
        Warnings about files that do not belong together, one sentence each.
    """

    files: tuple[SourceFile, ...]
    recordings: tuple[SourceFile, ...] = ()
    frfs: tuple[tuple[SourceFile, Frf], ...] = ()
    models: tuple[tuple[SourceFile, ModalModel], ...] = ()
    lobes: tuple[tuple[SourceFile, StabilityLobes], ...] = ()
    cutting: tuple[tuple[SourceFile, MillingProcess], ...] = field(default=())
    doubts: tuple[str, ...] = ()
    chatter: tuple[tuple[SourceFile, tuple[KeptCut, ...]], ...] = ()
    geometries: tuple[tuple[SourceFile, Geometry], ...] = ()

    def model_of(self, file: SourceFile, frf: Frf) -> tuple[SourceFile, ModalModel] | None:
        """Return the model that was fitted to an FRF, else a model with the same degrees of freedom as the FRF."""
        fitted = [pair for pair in self.models if pair[0].made_from(file) and pair[1].responses == frf.responses]
        alike = [
            pair for pair in self.models if (pair[1].responses, pair[1].excitations) == (frf.responses, frf.excitations)
        ]
        return next(iter(fitted + alike), None)

    def frf_of(self, model: SourceFile) -> Frf | None:
        """Return the FRF to which a model was fitted, else an FRF that was made from the same recordings."""
        fitted = [frf for file, frf in self.frfs if model.made_from(file)]
        alike = [frf for file, frf in self.frfs if _sources(file) & _sources(model)]
        return next(iter(fitted + alike), None)

    def recordings_of(self, frf: SourceFile) -> tuple[SourceFile, ...]:
        """Return the recordings among the files from which an FRF was estimated."""
        return tuple(file for file in self.recordings if frf.made_from(file))


def _sources(file: SourceFile) -> set[str]:
    return {source.get("sha256", "") for source in file.provenance.get("sources", [])}


def collect(paths: Sequence[str | os.PathLike[str]], reference: str | os.PathLike[str] | None = None) -> Collected:
    """Read every file; files may also belong to a ``reference`` model, which is not read.

    Raises
    ------
    InputError
        No file, or one that cannot be used.
    """
    if not paths:
        raise InputError("no file given; name recordings, FRFs, models, lobes, verdicts or a cutting file")
    files = tuple(_source(Path(path)) for path in paths if not is_side_file(path))  # *.json names them too

    def chosen(kind: str) -> tuple[SourceFile, ...]:
        return tuple(file for file in files if file.kind == kind)

    for file in chosen(FileKind.RECORDING):
        Recording(file.path).close()
    frfs = tuple((file, read_frf(file.path)) for file in chosen(FileKind.FRF))
    known = files if reference is None else (*files, _source(Path(reference)))
    doubts = check_belonging([ReportFile(file.path.name, file.kind, file.sha256, file.provenance) for file in known])
    return Collected(
        files,
        chosen(FileKind.RECORDING),
        frfs,
        tuple((file, read_modal_model(file.path)) for file in chosen(FileKind.MODEL)),
        tuple((file, read_lobes(file.path)) for file in chosen(FileKind.LOBES)),
        tuple((file, read_checked_cutting(file.path)[0]) for file in chosen(FileKind.CUTTING)),
        tuple(doubts),
        tuple((file, read_cuts(file.path)) for file in chosen(FileKind.CHATTER)),
        tuple((file, read_geometry(file.path)) for file in chosen(FileKind.GEOMETRY)),
    )


def _source(path: Path) -> SourceFile:
    kind = kind_of(path)
    stored = read_provenance(path) if kind in (FileKind.FRF, FileKind.MODEL, FileKind.LOBES, FileKind.CHATTER) else {}
    if kind == FileKind.CUTTING:
        stored = {**cutting_provenance(path), "warnings": read_checked_cutting(path)[1]}
    return SourceFile(path, kind, sha256(path), stored)


@contextmanager
def collection_paused() -> Iterator[None]:
    """Pause the garbage collector in the block.

    The objects of one figure would start several full collections, which take 0.2 s each.
    """
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()
