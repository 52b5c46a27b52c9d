"""The folder that the page works in: its files by kind, and in few words what each holds."""

from dataclasses import dataclass
from pathlib import Path

from millfrf.core import MillfrfError
from millfrf.core.terminal import silently
from millfrf.cutting import MillingProcess
from millfrf.gate import FileKind, kind_of
from millfrf.steps.inspect import open as open_file
from millfrf.steps.lobes import assumed_cut

FOREIGN = "other program"
"""Kind of a file that `millfrf convert` reads."""

FOREIGN_SUFFIXES = (".csv", ".dat", ".mat", ".npy", ".npz", ".tdms", ".txt", ".uff", ".unv", ".wav", ".xlsx")
BY_PLACEHOLDER = {
    "REC": (FileKind.RECORDING,),
    "FRF.h5": (FileKind.FRF,),
    "MODEL.json": (FileKind.MODEL,),
    "CUT.toml": (FileKind.CUTTING,),
    "LOBES.csv": (FileKind.LOBES,),
}
"""Kinds of the files that an option reads, by the placeholder of its help."""


@dataclass(frozen=True)
class FolderFile:
    """A file of the folder.

    Parameters
    ----------
    name
        Its name.
    kind
        Its kind, as `millfrf.gate.FileKind` names them; `FOREIGN` of another program's.
    """

    name: str
    kind: str


def files_in(folder: Path) -> tuple[FolderFile, ...]:
    """Return the files of a folder that the page can use, by name; others are left out."""
    listed = []
    for path in sorted(folder.iterdir()):
        if not path.is_file() or path.name.startswith("."):
            continue
        kind = _kind(path)
        if kind:
            listed.append(FolderFile(path.name, kind))
    return tuple(listed)


def _kind(path: Path) -> str:
    try:
        return str(kind_of(path))
    except (MillfrfError, OSError):
        return FOREIGN if path.suffix.lower() in FOREIGN_SUFFIXES else ""


def files_for(files: tuple[FolderFile, ...], placeholder: str) -> list[str]:
    """Return the names of the files that an option can read; of all known kinds where its placeholder says no kind.

    Examples
    --------
    >>> files = (FolderFile("a.h5", "recording"), FolderFile("m.json", "modal model"), FolderFile("b.csv", FOREIGN))
    >>> files_for(files, "REC"), files_for(files, "MODEL.json|FRF.h5"), files_for(files, "FILE")
    (['a.h5'], ['m.json'], ['a.h5', 'm.json', 'b.csv'])
    """
    kinds = [str(kind) for part in placeholder.split("|") for kind in BY_PLACEHOLDER.get(part, ())]
    return [file.name for file in files if file.kind in kinds or not kinds]


def description(path: Path) -> str:
    """Say in one line what a file holds, or why it cannot be read."""
    try:
        with silently():  # the commands have printed its warnings
            content = open_file(path)
    except (MillfrfError, OSError) as error:
        return " ".join(str(error).split())
    if isinstance(content, MillingProcess):
        return assumed_cut(content).partition(": the limits")[0]
    lines = repr(content).splitlines()
    return " ".join(line.strip() for line in lines[:2])
