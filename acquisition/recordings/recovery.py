"""Recovery of recordings that were left open or damaged, into a new complete file."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from millfrf.core import InputError, writing_whole_file
from millfrf.core.file_locks import is_being_written

from ..settings import SETTINGS
from ..sources.source import Events
from .recording import Recording
from .recording_writer import RecordingWriter
from .stream import DamagedRows, Stream


@dataclass(frozen=True)
class Recovered:
    """Result of a recovery: the recovered samples and events, and the lost ones.

    Parameters
    ----------
    path
        Path of the new file.
    samples
        Number of rows by stream, including missing ones between them.
    events
        Number of values by series.
    damaged
        Damaged rows by stream, with the reason. Damaged rows within a stream are NaN in the new file, those at its end
        are left out.
    damaged_values
        Number of damaged values by series, and of clock pairs as ``clock of <stream>``; they are left out.
    has_checksums
        Whether the source has checksums (format version 2). Without them a damaged sample is not noticed.
    """

    path: Path
    samples: dict[str, int]
    events: dict[str, int]
    damaged: dict[str, tuple[DamagedRows, ...]]
    damaged_values: dict[str, int]
    has_checksums: bool

    @property
    def lost(self) -> dict[str, int]:
        """Return the number of damaged rows by stream.

        It is zero after a kill, and more after a power failure or a bad sector.
        """
        return {name: sum(rows.end - rows.first for rows in damaged) for name, damaged in self.damaged.items()}


def recover(
    path: str | os.PathLike[str],
    out: str | os.PathLike[str] | None = None,
    progress: Callable[[int], None] | None = None,
    provenance: str = "",
    overwrite: bool = False,
) -> Recovered:
    """Copy the undamaged parts of a recording into a new complete file; the old file is not changed.

    Use it when the writer was killed, the power failed, or the disk damaged the file. Every block of samples is
    compared with its checksum, and only blocks that match are copied.

    Parameters
    ----------
    path
        The recording left behind.
    out
        New file; None: ``REC.recovered.h5`` in the same folder.
    progress
        Function that is called with the number of samples copied so far, over all streams.
    provenance
        Origin of the new file as JSON text; empty: the origin stated by the source.
    overwrite
        Whether an existing file ``out`` is replaced.

    Raises
    ------
    InputError
        The file is still being written, was closed in order and is undamaged, or ``out`` exists.
    FileFormatError
        The part of the file that locates its samples is damaged.
    """
    source = Path(path)
    target = Path(out) if out is not None else source.with_name(f"{source.stem}.recovered.h5")
    if not source.is_file():
        raise InputError(f"no file {source}; check the name")
    if target.exists() and (not overwrite or target.samefile(source)):
        raise InputError(f"{target} exists; choose another name as out (--out) or remove it first")
    if is_being_written(source):
        raise InputError(f"{source} is still being written; stop its writer first")
    with writing_whole_file(target) as temporary, Recording(source, accept_cut=True) as recording:
        if recording.complete and recording.format_version < 2:
            raise InputError(f"{source} was closed in order; there is nothing to recover")
        return _copy(recording, temporary, target, progress, provenance)


def _copy(
    recording: Recording, temporary: Path, target: Path, progress: Callable[[int], None] | None, provenance: str
) -> Recovered:
    source = recording.path
    event_series = recording.events
    needs_double = any(stream.dtype.itemsize == 8 for stream in recording.streams.values())
    samples: dict[str, int] = {}
    damaged: dict[str, tuple[DamagedRows, ...]] = {}
    n_events: dict[str, int] = {}

    def report(stream: str, written: int) -> None:
        samples[stream] = written
        if progress is not None:
            progress(sum(samples.values()))

    with RecordingWriter(
        temporary,
        [stream.description for stream in recording.streams.values()],
        title=recording.title,
        setup=recording.setup,
        dtype="float64" if needs_double else "float32",
        event_axes={name: series.axis for name, series in event_series.items()},
        recorded_at=recording.recorded_at,
        provenance=provenance or recording.provenance,
        overwrite=True,
        spare_bytes=SETTINGS.copy_spare_bytes,
    ) as writer:
        for name, stream in recording.streams.items():
            samples[name] = 0
            damaged[name] = _copy_stream(stream, writer, source.stat().st_size, report)
            writer.append_clock_pairs(name, recording.clock_pairs(name))
        for name, series in event_series.items():
            columns = series.read_raw()
            writer.append_events(Events(name, *columns, series.read_texts()))
            n_events[name] = len(columns[0])
        lost_values = _damaged_values(recording)
        if recording.complete and not lost_values and not any(damaged.values()):
            raise InputError(f"{source} was closed in order and every block is sound; there is nothing to recover")
        reason = "it is damaged" if recording.complete else "its writer did not close it"
        writer.close(complete=False, ending=f"recovered from {source.name}: {reason}")
    return Recovered(target, samples, n_events, damaged, lost_values, recording.format_version >= 2)


def _damaged_values(recording: Recording) -> dict[str, int]:
    counts = {name: series.damaged for name, series in recording.events.items()}
    counts |= {f"clock of {name}": recording.damaged_clock_pairs(name) for name in recording.streams}
    return {name: count for name, count in counts.items() if count}


def _copy_stream(
    stream: Stream, writer: RecordingWriter, file_size: int, report: Callable[[str, int], None]
) -> tuple[DamagedRows, ...]:
    """Copy the undamaged rows of a stream, with NaN for damaged rows between them; return the damaged rows."""
    damaged: list[DamagedRows] = []
    # Damaged rows are written when undamaged ones follow, so that those at the end of the stream are left out.
    pending: list[DamagedRows] = []
    written = 0
    for part in stream.recovered_parts(file_size):
        if isinstance(part, DamagedRows):
            damaged.append(part)
            pending.append(part)
            continue
        for gap in pending:
            written += _append_missing(stream, writer, gap.end - max(gap.first, written), gap.reason)
        pending = []
        rows = np.asarray(part, dtype=float)
        if np.isfinite(rows).all():
            writer.append(stream.name, rows)
        else:
            writer.append_with_missing(stream.name, rows, "NaN or infinite as they were recorded")
        written += len(rows)
        report(stream.name, written)
    return _merged(damaged)


def _append_missing(stream: Stream, writer: RecordingWriter, count: int, reason: str) -> int:
    """Append ``count`` rows of NaN, in pieces that fit into memory; return the number of rows written."""
    for start in range(0, count, 1 << 16):
        rows = np.full((min(count - start, 1 << 16), len(stream.channels)), np.nan)
        writer.append_with_missing(stream.name, rows, reason)
    return max(count, 0)


def _merged(damaged: list[DamagedRows]) -> tuple[DamagedRows, ...]:
    """Merge neighbouring rows with the same reason, and cut overlaps."""
    merged: list[DamagedRows] = []
    for rows in damaged:
        last = merged[-1] if merged else None
        if last is not None and last.end >= rows.first and last.reason == rows.reason:
            merged[-1] = DamagedRows(last.first, max(last.end, rows.end), last.reason)
        elif last is None or rows.end > last.end:
            merged.append(rows if last is None else DamagedRows(max(rows.first, last.end), rows.end, rows.reason))
    return tuple(merged)
