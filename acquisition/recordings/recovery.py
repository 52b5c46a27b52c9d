"""Recovery of recordings that were left open or damaged, into a new complete file."""

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, writing_whole_file

from ..sources.source import Events
from .durability import is_being_written
from .recording import Recording
from .recording_writer import RecordingWriter
from .stream import DamagedRows, Stream

_SPARE_BYTES = 1_000_000


@dataclass(frozen=True)
class Recovered:
    """Result of a recovery: the samples and events that came back, and what did not.

    Parameters
    ----------
    path
        The new file.
    samples
        Rows by stream, missing ones in their midst included.
    events
        Values by series.
    damaged
        Rows by stream that are not what was recorded, with the reason. Those in the midst of the stream are NaN in the
        new file, those at its end are left out.
    damaged_values
        Slow values by series, and clock pairs as ``clock of <stream>``, that are damaged and left out.
    has_checksums
        Whether the source has checksums (format version 2): without them a damaged sample cannot be told from a sound
        one.
    """

    path: Path
    samples: dict[str, int]
    events: dict[str, int]
    damaged: dict[str, tuple[DamagedRows, ...]]
    damaged_values: dict[str, int]
    has_checksums: bool

    @property
    def lost(self) -> dict[str, int]:
        """Damaged rows by stream; zero after a kill, more after a power failure or a bad sector."""
        return {name: sum(one.end - one.first for one in found) for name, found in self.damaged.items()}


def recover(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[int], None] | None = None,
    provenance: str = "",
    overwrite: bool = False,
) -> Recovered:
    """Copy what is sound of a recording into a new file that opens anywhere; the old one is left as it is.

    The writer was killed, the power failed, or the disk has damaged the file: every block of samples is compared with
    its checksum, and none is given back that does not match.

    Parameters
    ----------
    path
        The recording left behind.
    out
        New file; None: ``REC.recovered.h5`` beside it.
    progress
        Called with the number of samples copied, over all streams.
    provenance
        Where the new file comes from, as JSON text; empty: what the source says.
    overwrite
        Whether a file ``out`` may be replaced.

    Raises
    ------
    InputError
        The file is still being written, was closed in order and is sound, or ``out`` exists.
    FileFormatError
        What tells where its samples lie is damaged.
    """
    source = Path(path)
    target = Path(out) if out is not None else source.with_name(f"{source.stem}.recovered.h5")
    if not source.is_file():
        raise InputError(f"no file {source}; check the name")
    if target.exists() and (not overwrite or target.samefile(source)):
        raise InputError(f"{target} exists; choose another name as out (--out) or remove it first")
    if is_being_written(source):
        raise InputError(f"{source} is still being written; stop its writer first")
    with writing_whole_file(target) as temporary:
        return _copy(source, temporary, target, progress, provenance)


def _copy(
    source: Path, temporary: Path, target: Path, progress: Callable[[int], None] | None, provenance: str
) -> Recovered:
    with Recording(source, accept_cut=True) as recording:
        if recording.complete and recording.format_version < 2:
            raise InputError(f"{source} was closed in order; there is nothing to recover")
        series = recording.events
        size, damaged, n_events = source.stat().st_size, {}, {}
        with RecordingWriter(
            temporary,
            [stream.description for stream in recording.streams.values()],
            title=recording.title,
            setup=recording.setup,
            dtype=_widest(recording),
            event_axes={name: one.axis for name, one in series.items()},
            recorded_at=recording.recorded_at,
            provenance=provenance or recording.provenance,
            overwrite=True,
            spare_bytes=_SPARE_BYTES,
        ) as writer:
            copied = _Copied(writer, size, progress)
            for name, stream in recording.streams.items():
                damaged[name] = copied.stream(stream)
                writer.append_clock_pairs(name, recording.clock_pairs(name))
            for name, one in series.items():
                raw = one.read_raw()
                writer.append_events(Events(name, *raw, one.read_texts()))
                n_events[name] = len(raw[0])
            gone = {name: one.damaged for name, one in series.items()}
            gone |= {f"clock of {name}": recording.damaged_clock_pairs(name) for name in recording.streams}
            gone = {name: count for name, count in gone.items() if count}
            if recording.complete and not gone and not any(damaged.values()):
                raise InputError(f"{source} was closed in order and every block is sound; there is nothing to recover")
            how = "it is damaged" if recording.complete else "its writer did not close it"
            writer.close(complete=False, ending=f"recovered from {source.name}: {how}")
        checked = recording.format_version >= 2
    return Recovered(target, copied.samples, n_events, damaged, gone, checked)


def _widest(recording: Recording) -> Literal["float32", "float64"]:
    """The number format that holds all streams."""
    return "float64" if any(one.dtype.itemsize == 8 for one in recording.streams.values()) else "float32"


class _Copied:
    """Copies streams and counts what it copied."""

    def __init__(self, writer: RecordingWriter, size: int, progress: Callable[[int], None] | None) -> None:
        self.samples: dict[str, int] = {}
        self._writer, self._size, self._progress = writer, size, progress

    def stream(self, stream: Stream) -> tuple[DamagedRows, ...]:
        """Copy the sound rows of a stream, NaN for damaged ones between them; returns the damaged ones."""
        found: list[DamagedRows] = []
        waiting: list[DamagedRows] = []
        written = 0
        for part in stream.salvaged(self._size):
            if isinstance(part, DamagedRows):
                waiting.append(part)
                continue
            for one in waiting:
                for count in _pieces(one.end - max(one.first, written)):
                    gap = np.full((count, len(stream.channels)), np.nan)
                    self._writer.append_with_missing(stream.name, gap, one.reason)
                    written += count
            found, waiting = [*found, *waiting], []
            self._append(stream.name, np.asarray(part, dtype=float))
            written += len(part)
            self.samples[stream.name] = written
            if self._progress is not None:
                self._progress(sum(self.samples.values()))
        self.samples[stream.name] = written
        return _joined([*found, *waiting])

    def _append(self, name: str, rows: NDArray[np.float64]) -> None:
        if np.isfinite(rows).all():
            self._writer.append(name, rows)
        else:
            self._writer.append_with_missing(name, rows, "NaN or infinite as they were recorded")


def _pieces(count: int) -> Iterator[int]:
    """Numbers of rows, together ``count``, that are written at a time."""
    while count > 0:
        yield min(count, 1 << 16)
        count -= 1 << 16


def _joined(found: list[DamagedRows]) -> tuple[DamagedRows, ...]:
    """Neighbouring rows with one reason as one."""
    joined: list[DamagedRows] = []
    for one in found:
        last = joined[-1] if joined else None
        if last is not None and last.end >= one.first and last.reason == one.reason:
            joined[-1] = DamagedRows(last.first, max(last.end, one.end), last.reason)
        elif last is None or one.end > last.end:
            joined.append(one if last is None else DamagedRows(max(one.first, last.end), one.end, one.reason))
    return tuple(joined)
