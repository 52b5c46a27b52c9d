"""Files of one report: do they come from each other, as their hashes say?"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Given:
    """A file of a report.

    Parameters
    ----------
    name
        Name of the file without its folder.
    kind
        Kind of the file, as ``millfrf.file_kinds`` names it.
    sha256
        SHA-256 hash of its bytes.
    provenance
        Sources and versions that the file states.
    """

    name: str
    kind: str
    sha256: str
    provenance: Mapping[str, Any]

    @property
    def sources(self) -> dict[str, str]:
        """Hash to name of the files it was made from."""
        stored = self.provenance.get("sources", [])
        return {str(one.get("sha256")): str(one.get("file")) for one in stored if isinstance(one, dict)}


MADE_OF: dict[str, tuple[tuple[str, ...], ...]] = {
    "frf": (("recording",),),
    "modal model": (("recording", "frf", "modal model"),),
    "lobes": (("frf", "modal model"), ("cutting data",)),
    "chatter verdicts": (("cutting data",),),
}
"""For each kind, groups of kinds that it is made of: one file of each group is expected, where any of it is given."""


def check_belonging(files: Sequence[Given]) -> list[str]:
    """Judge whether the files of a report belong together.

    A file that states its sources is held against the given files of the kinds that it is made of. One of the same
    name but other bytes has changed since; where none is a source, nor made from one of the same sources, the file
    belongs to something else. An FRF or a model may also be tied to them by other FRFs and models, as taps are that
    carried a model to the tool tip. Files that state no sources are not judged.

    Returns
    -------
    list of str
        Doubts: sentences for a warning; empty where nothing is odd.
    """
    doubts = [f"{name} is given twice" for name in _twice(files)]
    for file in files:
        if not file.sources:
            continue
        for group in MADE_OF.get(file.kind, ()):
            others = [one for one in files if one is not file and one.kind in group]
            doubts += _judged(file, others, _tied(file, files))
    return doubts


def _tied(file: Given, files: Sequence[Given]) -> set[str]:
    """Hashes of all files that FRFs and models tie to one, step by step; of a table of lobes none but itself."""
    tied, measured = {file.sha256}, [one for one in files if one.kind in ("frf", "modal model")]
    if file not in measured:
        return tied
    while True:
        families = [{one.sha256, *one.sources} for one in measured]
        grown = tied.union(*(family for family in families if family & tied))
        if grown == tied:
            return tied
        tied = grown


def _twice(files: Sequence[Given]) -> list[str]:
    hashes = [file.sha256 for file in files]
    return [file.name for i, file in enumerate(files) if file.sha256 in hashes[:i]]


def _judged(file: Given, others: Sequence[Given], tied: set[str]) -> list[str]:
    """One file against those that could be its sources."""
    changed = [one for one in others if one.name in file.sources.values() and one.sha256 not in file.sources]
    if changed:
        return [
            f"{file.name} was not made from {one.name} as it is now: the file has changed since; make {file.name} anew"
            for one in changed
        ]
    if not others or any(one.sha256 in tied or _related(file, one) for one in others):
        return []
    return [
        f"{file.name} was not made from {', '.join(one.name for one in others)} but from "
        f"{', '.join(file.sources.values())}: they may belong to different tests"
    ]


def _related(file: Given, other: Given) -> bool:
    """Made from it, made from the same files, or it from this one."""
    return other.sha256 in file.sources or file.sha256 in other.sources or bool(set(other.sources) & set(file.sources))
