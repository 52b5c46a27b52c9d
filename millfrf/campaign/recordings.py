"""Find, open and label the recordings of a campaign; detect copies and contradictory postures."""

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

KEPT = "recordings.json"  # cache of sizes, hashes and headers in the folder of results
_THREADS = 8  # most threads that hash files


@dataclass(frozen=True)
class FileLook:
    """Size, time of change, hash and header of a file."""

    size: int  # bytes
    changed: int  # ns; time of the last change
    digest: str = ""  # SHA-256 of the content; empty: not known yet
    setup: str = ""
    recorded_at: str = ""
    streams: tuple[tuple[str, int, float], ...] = ()  # name, number of samples, sample rate (Hz)
    fault: str = ""  # why it cannot be opened as a recording; empty: none


def look_at_recordings(paths: Sequence[Path], earlier: dict[str, FileLook], base: Path) -> dict[str, FileLook]:
    """Read the header of each recording whose size or time of change differs from the cache; compute no hash."""
    looks = {}
    with progress("looking at recordings", len(paths)) as update:
        for number, path in enumerate(paths, 1):
            name, stat = place_below(path, base), path.stat()
            look = earlier.get(name)
            if look is None or (look.size, look.changed) != (stat.st_size, stat.st_mtime_ns):
                look = _look(path, stat)
            looks[name] = look
            update(number)
    return looks


def hash_all(looks: dict[str, FileLook], base: Path) -> dict[str, FileLook]:
    """Hash each file whose hash is not known, in several threads."""
    names = [name for name, look in looks.items() if not look.digest]
    hashed = dict(looks)
    with progress("hashing", len(names)) as update, ThreadPoolExecutor(min(_THREADS, os.cpu_count() or 1)) as pool:
        digests = pool.map(lambda name: sha256(base / name), names)
        for number, (name, digest) in enumerate(zip(names, digests, strict=True), 1):
            hashed[name] = replace(hashed[name], digest=digest)
            update(number)
    return hashed


def look_at_other(path: Path, earlier: dict[str, FileLook], base: Path) -> FileLook:
    """Return size, time and hash of a file that is no recording; a missing file has size -1."""
    try:
        stat = path.stat()
    except OSError:
        return FileLook(-1, 0, "missing")
    look = earlier.get(place_below(path, base))
    if look is not None and look.digest and (look.size, look.changed) == (stat.st_size, stat.st_mtime_ns):
        return look
    return FileLook(stat.st_size, stat.st_mtime_ns, sha256(path))


def place_below(path: Path, base: Path) -> str:
    """Return a path relative to the folder of the campaign if the file lies there, else the path unchanged."""
    return path.relative_to(base).as_posix() if path.is_relative_to(base) else str(path)


def _look(path: Path, stat: os.stat_result) -> FileLook:
    look = FileLook(stat.st_size, stat.st_mtime_ns)
    try:
        with Recording(path) as recording:
            streams = tuple((name, stream.n_samples, stream.sample_rate) for name, stream in recording.streams.items())
            return replace(look, setup=recording.setup, recorded_at=recording.recorded_at, streams=streams)
    except InputError as error:
        return replace(look, fault=str(error).replace(f"{path.parent}{os.sep}", ""))


def read_kept(folder: Path) -> dict[str, FileLook]:
    """Read the cache of an earlier run; an unreadable cache counts as empty."""
    try:
        stored = json.loads((folder / KEPT).read_text(encoding="utf-8"))
        return {
            name: FileLook(**{**fields, "streams": tuple((str(n), int(s), float(r)) for n, s, r in fields["streams"])})
            for name, fields in stored.items()
        }
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return {}


def keep(folder: Path, looks: dict[str, FileLook]) -> None:
    """Write the cache for the next run."""
    with writing_whole_file(folder / KEPT) as temporary:
        temporary.write_text(json.dumps({name: asdict(look) for name, look in looks.items()}), encoding="utf-8")


@dataclass(frozen=True)
class FoundRecording:
    """One recording of a campaign."""

    name: str  # name of the file without suffix; tasks have this name
    path: Path
    labels: Labels
    look: FileLook
    recorded_at: float | None  # s since 1970
    fault: str = ""  # why it cannot be used or labelled; empty: none


def find_recordings(file: CampaignFile, base: Path, out: Path, earlier: dict[str, FileLook]) -> list[FoundRecording]:
    """Find, open and label all recordings, sorted by name."""
    entries = [(path, table, row) for table in file.recordings for path, row in _files(table, base)]
    _refuse_clashes([path for path, _, _ in entries], base, out)
    looks = look_at_recordings([path for path, _, _ in entries], earlier, base)
    return [
        _labelled(path, looks[place_below(path, base)], table, row)
        for path, table, row in sorted(entries, key=lambda entry: entry[0].stem)
    ]


def _files(table: RecordingsTable, base: Path) -> list[tuple[Path, Mapping[str, Any] | None]]:
    """Return the files of one table, each with its row of labels (None: the label table has no row for it)."""
    paths = {path: None for pattern in table.files for path in _matching(pattern, base)}
    if table.table is None:
        return [(path, {}) for path in paths]
    rows = {base / name: row for name, row in read_label_table(base / table.table).items()}
    for path in rows:
        if not path.is_file():
            raise InputError(
                f"table {table.table} names {place_below(path, base)}, which does not exist; correct the name"
            )
        if paths and path not in paths:
            raise InputError(
                f"table {table.table} names {place_below(path, base)}, which does not match files; correct one"
            )
    return [(path, rows.get(path)) for path in paths or rows]


def _matching(pattern: str, base: Path) -> list[Path]:
    """Return the files that match a name with wildcards."""
    absolute = str(Path(glob.escape(str(base))) / pattern)
    matches = sorted(glob.glob(absolute, recursive=True))  # noqa: PTH207 -- Path.glob takes no absolute patterns
    paths = [Path(name) for name in matches if Path(name).is_file()]
    if not paths:
        raise InputError(f"no file {pattern} in {base}; check files in [[recordings]]")
    return paths


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
    """Convert an ISO 8601 time to seconds since 1970; a time without zone is UTC."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        return None
    return (moment if moment.tzinfo is not None else moment.replace(tzinfo=UTC)).timestamp()


def without_copies(recordings: Sequence[FoundRecording], digests: Mapping[str, str]) -> list[FoundRecording]:
    """Find recordings with equal content, and mark the copies as faulty.

    The first of several copies with equal labels is used. If the labels differ, it is unknown which are right, and
    all copies are faulty.
    """
    by_digest: dict[str, list[FoundRecording]] = {}
    for recording in recordings:
        if digests[recording.name] and not recording.fault:
            by_digest.setdefault(digests[recording.name], []).append(recording)
    faults: dict[str, str] = {}
    for copies in by_digest.values():
        equal_labels = all(recording.labels == copies[0].labels for recording in copies)
        for recording in copies[1 if equal_labels else 0 :] if len(copies) > 1 else ():
            other = copies[0] if recording is not copies[0] else copies[1]
            remedy = "give each test once" if equal_labels else "their labels differ, and it is unknown which are right"
            faults[recording.name] = f"{recording.path.name} is the same recording as {other.path.name}; {remedy}"
    return [
        replace(recording, fault=faults[recording.name]) if recording.name in faults else recording
        for recording in recordings
    ]


POSE = "pose"  # label of the posture in which recordings were made
POSTURE_TOLERANCE = 0.1  # deg or m; robots repeat a posture more exactly than that

Posture = tuple[float, ...]


def without_wrong_postures(recordings: Sequence[FoundRecording]) -> list[FoundRecording]:
    """Mark recordings whose posture contradicts the other recordings of the same pose as faulty.

    If more than half of the recordings of a pose state the same posture, this posture is right. Without such a majority
    the right posture is unknown, and all recordings of the pose that state a posture are faulty.
    """
    by_pose: dict[str | float, list[FoundRecording]] = {}
    for recording in recordings:
        if not recording.fault and recording.labels.posture_deg is not None and POSE in recording.labels.values:
            by_pose.setdefault(recording.labels.values[POSE], []).append(recording)
    faults = {
        member.name: fault for pose, members in by_pose.items() for member, fault in _contradictions(str(pose), members)
    }
    return [
        replace(recording, fault=faults[recording.name]) if recording.name in faults else recording
        for recording in recordings
    ]


def agree(first: Posture, second: Posture) -> bool:
    """Return whether two stated postures are equal within :data:`POSTURE_TOLERANCE`.

    Examples
    --------
    >>> agree((10.0, -20.0), (10.01, -20.0)), agree((10.0, -20.0), (12.0, -20.0)), agree((10.0,), (10.0, 0.0))
    (True, False, False)
    """
    return len(first) == len(second) and all(
        abs(a - b) <= POSTURE_TOLERANCE for a, b in zip(first, second, strict=True)
    )


def _contradictions(pose: str, members: Sequence[FoundRecording]) -> list[tuple[FoundRecording, str]]:
    postures = [recording.labels.posture_deg or () for recording in members]
    support = [sum(agree(recording, other) for other in postures) for recording in postures]
    best = max(range(len(members)), key=support.__getitem__)
    if support[best] == len(members):
        return []
    if 2 * support[best] <= len(members):
        return [
            (
                recording,
                f"{recording.path.name}: the {len(members)} recordings of pose {pose} state different postures, none "
                "of them more than half: it is unknown which is right; correct their setups",
            )
            for recording in members
        ]
    majority = postures[best]
    return [
        (
            recording,
            f"{recording.path.name}: it states posture_deg = {_shown(posture)}, and {support[best]} other recordings "
            f"of pose {pose} state {_shown(majority)}; correct its setup, or its label pose",
        )
        for recording, posture in zip(members, postures, strict=True)
        if not agree(posture, majority)
    ]


def _shown(posture: Posture) -> str:
    return f"[{', '.join(f'{angle:.6g}' for angle in posture)}]"
