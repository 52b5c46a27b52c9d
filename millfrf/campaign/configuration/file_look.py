"""What a campaign must know of a recording before it plans: its setup, its length, its content's hash; kept for later.

Size and time of change tell whether a file is what it was: a file that has neither changed is not read again.
"""

import json
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from acquisition import Recording
from millfrf.core import InputError, writing_whole_file

from ...progress import Progress, silent
from ...provenance import sha256

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


def look_at_recordings(
    paths: Sequence[Path], kept: dict[str, FileLook], base: Path, progress: Progress = silent
) -> dict[str, FileLook]:
    """Look into each recording whose size or time of change is not what it was; hashes are left as they are.

    Parameters
    ----------
    paths
        Paths of the files.
    kept
        What was seen before, by the file's place below ``base``.
    base
        Folder of the campaign.
    progress
        Shows progress, such as ``millfrf.progress.bar``.
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


def hash_all(looks: dict[str, FileLook], base: Path, progress: Progress = silent) -> dict[str, FileLook]:
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
