"""The recordings of a campaign: found by name, looked into, and labelled."""

import glob
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from millfrf.core import InputError

from ...progress import Progress, silent
from .campaign_tables import CampaignFile, RecordingsTable
from .file_look import FileLook, look_at_recordings, place_below
from .labels import Labels, checked_pattern, joined_labels, labels_of_name, labels_of_setup, read_label_table


@dataclass(frozen=True)
class FoundRecording:
    """One recording of a campaign.

    Parameters
    ----------
    name
        Name of the file without its suffix, by which tasks are called.
    path
        Path of the file.
    labels
        Labels of the recording.
    look
        What was seen of the file.
    recorded_at : s
        Time of recording since 1970, or None.
    fault
        Why it cannot be used or labelled; empty: it can.
    """

    name: str
    path: Path
    labels: Labels
    look: FileLook
    recorded_at: float | None
    fault: str = ""


def find_recordings(
    file: CampaignFile, base: Path, out: Path, kept: dict[str, FileLook], progress: Progress = silent
) -> list[FoundRecording]:
    """Find, open and label all recordings, in the order of their names.

    Parameters
    ----------
    file
        Campaign as its file states it.
    base
        Folder of its file, from which names of files are told.
    out
        Folder of results; no recording may lie in it.
    kept
        What earlier runs have seen.
    progress
        Shows progress, such as ``millfrf.progress.bar``.

    Raises
    ------
    InputError
        A name without a file, two recordings with one name, or a table that does not fit.
    """
    named = [(path, table, row) for table in file.recordings for path, row in _files(table, base)]
    _refuse_clashes([path for path, _, _ in named], base, out)
    looks = look_at_recordings([path for path, _, _ in named], kept, base, progress)
    found = [
        _labelled(path, looks[place_below(path, base)], table, row)
        for path, table, row in sorted(named, key=lambda one: one[0].stem)
    ]
    return found


def _files(table: RecordingsTable, base: Path) -> list[tuple[Path, Mapping[str, Any] | None]]:
    """Files of one table with the row of labels of each."""
    paths = {path: None for pattern in table.files for path in _matching(pattern, base)}
    if table.table is None:
        return [(path, {}) for path in paths]
    rows = {_absolute(base, name): row for name, row in read_label_table(base / table.table).items()}
    for path in rows:
        if not path.is_file():
            raise InputError(f"table {table.table} names {place_below(path, base)}, and there is no such file")
        if paths and path not in paths:
            raise InputError(f"table {table.table} names {place_below(path, base)}, which files does not; correct one")
    return [(path, rows.get(path)) for path in paths or rows]


def _absolute(base: Path, name: str) -> Path:
    return base / name


def _matching(pattern: str, base: Path) -> list[Path]:
    """Files of a name with wildcards, or the one of a plain name."""
    asked = str(Path(glob.escape(str(base))) / pattern)
    matches = sorted(glob.glob(asked, recursive=True))  # noqa: PTH207 -- Path.glob takes no absolute patterns
    found = [Path(name) for name in matches if Path(name).is_file()]
    if not found:
        raise InputError(f"no file {pattern} in {base}; check files in [[recordings]]")
    return found


def _refuse_clashes(paths: list[Path], base: Path, out: Path) -> None:
    seen: dict[str, Path] = {}
    for path in paths:
        if path.resolve().is_relative_to(out.resolve()):
            raise InputError(
                f"recording {place_below(path, base)} lies in {out}, the folder of this campaign's results: a result "
                "cannot be its own input (a cycle); choose another --out, or other files"
            )
        first = seen.setdefault(path.stem, path)
        if first is not path:
            raise InputError(
                f"two recordings have the name {path.stem}: {place_below(first, base)} and {place_below(path, base)}; "
                "rename one"
            )


def _labelled(path: Path, look: FileLook, table: RecordingsTable, row: Mapping[str, Any] | None) -> FoundRecording:
    fault, sources = look.fault, [row or {}]
    pattern = None if table.pattern is None else checked_pattern(table.pattern)
    try:
        if pattern is not None:
            sources.append(labels_of_name(pattern, path.stem))
        if row is None:
            fault = fault or f"{path.name}: it has no row in {table.table}, and so no labels"
        if not look.fault:
            sources.append(labels_of_setup(look.setup, table.setup))
        labels = joined_labels(sources)
    except InputError as error:
        fault = fault or f"{path.name}: {error}"
        labels = Labels({})
    return FoundRecording(path.stem, path, labels, look, _seconds(look.recorded_at), fault)


def _seconds(text: str) -> float | None:
    """Seconds since 1970 of a time as ISO 8601 writes it; without a zone it is UTC."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    return (moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)).timestamp()
