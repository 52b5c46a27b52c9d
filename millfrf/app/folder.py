"""The folder that the page works in: its files by kind, and in few words what each holds."""

from contextlib import nullcontext
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from acquisition import Recording
from millfrf.core import MillfrfError
from millfrf.core.terminal import silently
from millfrf.cutting import MillingProcess
from millfrf.gate import FileKind, kind_of
from millfrf.steps.inspect import open as open_file
from millfrf.steps.lobes import assumed_cut

FOREIGN = "other program"
"""Kind of a file that `millfrf convert` reads."""

SETTINGS = "settings"
"""Kind of a TOML file that describes a session, a mapping, a campaign or a robot."""

FOREIGN_SUFFIXES = (".csv", ".dat", ".mat", ".npy", ".npz", ".tdms", ".txt", ".uff", ".unv", ".wav", ".xlsx")
BY_PLACEHOLDER = {
    **dict.fromkeys(("REC", "REC.h5", "SIM.h5", "CUTS"), (FileKind.RECORDING,)),
    **dict.fromkeys(("FRF", "FRF.h5", "TT.h5", "ST.h5"), (FileKind.FRF,)),
    "MODEL.json": (FileKind.MODEL,),
    "CUT.toml": (FileKind.CUTTING,),
    "POLES.toml": (FileKind.POLES,),
    "GEOMETRY": (FileKind.GEOMETRY,),
    "FILES": tuple(FileKind),
}
"""Kinds of the files that an option reads, by the placeholder of its help; of further TOML files settings."""


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
        kind = _kind(path, _stamp(path))
        if kind:
            listed.append(FolderFile(path.name, kind))
    return tuple(listed)


def _stamp(path: Path) -> tuple[int, int]:
    """Return time and size: a file with the same is not read again."""
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@lru_cache(maxsize=4096)
def _kind(path: Path, stamp: tuple[int, int]) -> str:
    del stamp
    try:
        return str(kind_of(path))
    except (MillfrfError, OSError):
        suffix = path.suffix.lower()
        return SETTINGS if suffix == ".toml" else FOREIGN if suffix in FOREIGN_SUFFIXES else ""


def files_for(files: tuple[FolderFile, ...], placeholder: str) -> list[str]:
    """Return the names of the files that an option can read; of all known kinds where its placeholder says no kind.

    Examples
    --------
    >>> files = (FolderFile("a.h5", "recording"), FolderFile("m.json", "modal model"), FolderFile("b.csv", FOREIGN))
    >>> files_for(files, "REC..."), files_for(files, "MODEL.json|FRF.h5"), files_for(files, "FILE")
    (['a.h5'], ['m.json'], ['a.h5', 'm.json', 'b.csv'])
    >>> files_for((*files, FolderFile("s.toml", SETTINGS)), "SESSION.toml")
    ['s.toml']
    """
    parts = placeholder.replace("...", "").split("|")
    kinds = [str(kind) for part in parts for kind in BY_PLACEHOLDER.get(part, ())]
    kinds += [SETTINGS for part in parts if part.endswith(".toml") and part not in BY_PLACEHOLDER]
    return [file.name for file in files if file.kind in kinds or not kinds]


def description(path: Path) -> str:
    """Say in one line what a file holds, or why it cannot be read."""
    return _description(path, _stamp(path))


@lru_cache(maxsize=4096)
def _description(path: Path, stamp: tuple[int, int]) -> str:
    del stamp
    try:
        with silently():  # the commands have printed its warnings
            content = open_file(path)
            with content if isinstance(content, Recording) else nullcontext():
                lines = repr(content).splitlines()
    except (MillfrfError, OSError) as error:
        return " ".join(str(error).split())
    if isinstance(content, MillingProcess):
        return assumed_cut(content).partition(": the limits")[0]
    return " ".join(line.strip() for line in lines[:2])
