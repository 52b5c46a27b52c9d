"""Recordings of a campaign: found by name, read, labelled, checked for copies and for their stated posture."""

import glob
import json
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from acquisition import Recording
from millfrf.core import InputError, writing_whole_file
from millfrf.core.progress import progress
from millfrf.core.provenance import sha256

from .campaign_tables import CampaignFile, RecordingsTable
from .labels import Labels, checked_pattern, joined_labels, labels_of_name, labels_of_setup, read_label_table

KEPT = "recordings.json"
"""File in the folder of results that keeps what was seen."""

_THREADS = 8


@dataclass(frozen=True)
class FileLook:
    """What was seen of a file.

    Parameters
    ----------
    size : bytes
        Size of the file.
    changed : ns
        Time of its last change.
    digest
        SHA-256 of its content; empty: not known yet.
    setup, recorded_at
        Texts that a recording holds.
    streams
        Number of samples and sample rate (Hz) by stream.
    fault
        Why it cannot be opened as a recording; empty: it can.
    """

    size: int
    changed: int
    digest: str = ""
    setup: str = ""
    recorded_at: str = ""
    streams: tuple[tuple[str, int, float], ...] = ()
    fault: str = ""


def look_at_recordings(paths: Sequence[Path], kept: dict[str, FileLook], base: Path) -> dict[str, FileLook]:
    """Look into each recording whose size or time of change is not what it was; hashes are left as they are.

    Parameters
    ----------
    paths
        Paths of the files.
    kept
        What was seen before, by the file's place below ``base``.
    base
        Folder of the campaign.
    """
    found = {}
    with progress("looking at recordings", len(paths)) as update:
        for number, path in enumerate(paths, 1):
            name, now = place_below(path, base), path.stat()
            before = kept.get(name)
            if before is None or (before.size, before.changed) != (now.st_size, now.st_mtime_ns):
                before = _look(path, now)
            found[name] = before
            update(number)
    return found


def hash_all(looks: dict[str, FileLook], base: Path) -> dict[str, FileLook]:
    """Hash the content of each file whose hash is not known, several at a time."""
    wanted = [name for name, look in looks.items() if not look.digest]
    found = dict(looks)
    with progress("hashing", len(wanted)) as update, ThreadPoolExecutor(min(_THREADS, os.cpu_count() or 1)) as pool:
        digests = pool.map(lambda name: sha256(base / name), wanted)
        for number, (name, digest) in enumerate(zip(wanted, digests, strict=True), 1):
            found[name] = replace(found[name], digest=digest)
            update(number)
    return found


def look_at_other(path: Path, kept: dict[str, FileLook], base: Path) -> FileLook:
    """Size, time and hash of a file that is no recording; a file that is not there has neither."""
    try:
        now = path.stat()
    except OSError:
        return FileLook(-1, 0, "missing")
    before = kept.get(place_below(path, base))
    if before is not None and before.digest and (before.size, before.changed) == (now.st_size, now.st_mtime_ns):
        return before
    return FileLook(now.st_size, now.st_mtime_ns, sha256(path))


def place_below(path: Path, base: Path) -> str:
    """A path as the campaign writes it: from its folder where it lies below, else as it is."""
    return path.relative_to(base).as_posix() if path.is_relative_to(base) else str(path)


def _look(path: Path, now: os.stat_result) -> FileLook:
    known = FileLook(now.st_size, now.st_mtime_ns)
    try:
        with Recording(path) as recording:
            streams = tuple((name, one.n_samples, one.sample_rate) for name, one in recording.streams.items())
            return replace(known, setup=recording.setup, recorded_at=recording.recorded_at, streams=streams)
    except InputError as error:
        return replace(known, fault=str(error).replace(f"{path.parent}{os.sep}", ""))


def read_kept(folder: Path) -> dict[str, FileLook]:
    """What an earlier run kept; nothing where it cannot be read."""
    try:
        stored = json.loads((folder / KEPT).read_text(encoding="utf-8"))
        return {
            name: FileLook(**{**one, "streams": tuple((str(n), int(s), float(r)) for n, s, r in one["streams"])})
            for name, one in stored.items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}


def keep(folder: Path, looks: dict[str, FileLook]) -> None:
    """Keep what was seen for the next run."""
    with writing_whole_file(folder / KEPT) as temporary:
        temporary.write_text(json.dumps({name: asdict(one) for name, one in looks.items()}), encoding="utf-8")


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


def find_recordings(file: CampaignFile, base: Path, out: Path, kept: dict[str, FileLook]) -> list[FoundRecording]:
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

    Raises
    ------
    InputError
        A name without a file, two recordings with one name, or a table that does not fit.
    """
    named = [(path, table, row) for table in file.recordings for path, row in _files(table, base)]
    _refuse_clashes([path for path, _, _ in named], base, out)
    looks = look_at_recordings([path for path, _, _ in named], kept, base)
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


def without_copies(recordings: Sequence[FoundRecording], digests: Mapping[str, str]) -> list[FoundRecording]:
    """Give a fault to each recording whose content another has, too.

    Of copies with equal labels the first is kept. Where labels differ nobody can tell which copy has its own, and all
    have the fault.

    Parameters
    ----------
    recordings
        Recordings of the campaign, labelled.
    digests
        SHA-256 of the content by the recording's name; empty: not known.
    """
    alike: dict[str, list[FoundRecording]] = {}
    for one in recordings:
        if digests[one.name] and not one.fault:
            alike.setdefault(digests[one.name], []).append(one)
    faults: dict[str, str] = {}
    for copies in alike.values():
        same = all(one.labels == copies[0].labels for one in copies)
        for one in copies[1 if same else 0 :] if len(copies) > 1 else ():
            other = copies[0] if one is not copies[0] else copies[1]
            remedy = "give each test once" if same else "their labels differ, and which are right cannot be told"
            faults[one.name] = f"{one.path.name} is the same recording as {other.path.name}; {remedy}"
    return [replace(one, fault=faults[one.name]) if one.name in faults else one for one in recordings]


POSE = "pose"
"""Label of recordings that were made in one posture."""

SAME = 0.1
"""Largest difference of two statements of one posture, degrees or m: a robot stops more exactly than that."""

Posture = tuple[float, ...]


def without_wrong_postures(recordings: Sequence[FoundRecording]) -> list[FoundRecording]:
    """Give a fault to each recording whose posture contradicts that of the other recordings of its pose.

    What more than half of a pose's recordings state counts. Where no posture has a majority nobody can tell which is
    right, and every recording that states one has the fault.

    Parameters
    ----------
    recordings
        All recordings, labelled.
    """
    stated: dict[str | float, list[FoundRecording]] = {}
    for one in recordings:
        if not one.fault and one.labels.posture_deg is not None and POSE in one.labels.values:
            stated.setdefault(one.labels.values[POSE], []).append(one)
    faults = {
        member.name: fault for pose, members in stated.items() for member, fault in _contradictions(str(pose), members)
    }
    return [replace(one, fault=faults[one.name]) if one.name in faults else one for one in recordings]


def agree(one: Posture, other: Posture) -> bool:
    """Say whether two statements are of one posture.

    Examples
    --------
    >>> agree((10.0, -20.0), (10.01, -20.0)), agree((10.0, -20.0), (12.0, -20.0)), agree((10.0,), (10.0, 0.0))
    (True, False, False)
    """
    return len(one) == len(other) and all(abs(a - b) <= SAME for a, b in zip(one, other, strict=True))


def _contradictions(pose: str, members: Sequence[FoundRecording]) -> list[tuple[FoundRecording, str]]:
    postures = [one.labels.posture_deg or () for one in members]
    support = [sum(agree(one, other) for other in postures) for one in postures]
    most = max(range(len(members)), key=support.__getitem__)
    if support[most] == len(members):
        return []
    if 2 * support[most] <= len(members):
        return [
            (
                one,
                f"{one.path.name}: the {len(members)} recordings of pose {pose} state different postures, none of "
                "them more than half: which is right cannot be told; correct their setups",
            )
            for one in members
        ]
    right = postures[most]
    return [
        (
            one,
            f"{one.path.name}: it states posture_deg = {_shown(own)}, and {support[most]} other recordings of pose "
            f"{pose} state {_shown(right)}; correct its setup, or its label pose",
        )
        for one, own in zip(members, postures, strict=True)
        if not agree(own, right)
    ]


def _shown(posture: Posture) -> str:
    return f"[{', '.join(f'{angle:.6g}' for angle in posture)}]"
