"""Recovery of recordings that were left open or damaged, into a new complete file."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from millfrf.core import InputError, Real, writing_whole_file
from millfrf.core.file_locks import is_being_written

from ..settings import SETTINGS
from .recording_writer import RecordingWriter
from .salvage import Salvage
from .stream import DamagedRows, Stream

_UNSTATED = "NaN or infinite as they were recorded"


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
    notes
        What else is damaged in the source, a line each; such as a text that differs from its copy, which was taken.
    """

    path: Path
    samples: dict[str, int]
    events: dict[str, int]
    damaged: dict[str, tuple[DamagedRows, ...]]
    damaged_values: dict[str, int]
    has_checksums: bool
    notes: tuple[str, ...] = ()

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
        Neither HDF5 nor the journal of the file states what was recorded.
    """
    source = Path(path)
    target = Path(out) if out is not None else source.with_name(f"{source.stem}.recovered.h5")
    if not source.is_file():
        raise InputError(f"no file {source}; check the name")
    if target.exists() and (not overwrite or target.samefile(source)):
        raise InputError(f"{target} exists; choose another name as out (--out) or remove it first")
    if is_being_written(source):
        raise InputError(f"{source} is still being written; stop its writer first")
    with writing_whole_file(target) as temporary, Salvage(source) as salvage:
        if salvage.complete and salvage.format_version < 2:
            raise InputError(f"{source} was closed in order; there is nothing to recover")
        return _copy(salvage, temporary, target, progress, provenance)


def _copy(
    salvage: Salvage, temporary: Path, target: Path, progress: Callable[[int], None] | None, provenance: str
) -> Recovered:
    source, streams = salvage.path, salvage.streams
    needs_double = any(stream.dtype.itemsize == 8 for stream in streams.values())
    samples: dict[str, int] = {}
    damaged: dict[str, tuple[DamagedRows, ...]] = {}
    n_events: dict[str, int] = {}
    lost_values: dict[str, int] = {}

    def report(stream: str, written: int) -> None:
        samples[stream] = written
        if progress is not None:
            progress(sum(samples.values()))

    with RecordingWriter(
        temporary,
        [stream.description for stream in streams.values()],
        title=salvage.text("title"),
        setup=salvage.text("setup"),
        dtype="float64" if needs_double else "float32",
        event_axes=salvage.event_axes,
        recorded_at=salvage.text("recorded_at"),
        provenance=provenance or salvage.text("provenance"),
        overwrite=True,
        spare_bytes=SETTINGS.copy_spare_bytes,
    ) as writer:
        for name, stream in streams.items():
            samples[name] = 0
            damaged[name] = _copy_stream(stream, salvage.missing(name), writer, source.stat().st_size, report)
            if salvage.complete:
                salvage.note_unreadable(name)
            pairs, lost_values[f"clock of {name}"] = salvage.clock_pairs(name)
            writer.append_clock_pairs(name, pairs)
        for name in salvage.event_axes:
            events, lost_values[name] = salvage.events(name)
            writer.append_events(events)
            n_events[name] = len(events.times)
        lost_values = {name: count for name, count in lost_values.items() if count}
        if salvage.complete and not salvage.notes and not lost_values and not any(damaged.values()):
            raise InputError(f"{source} was closed in order and every block is sound; there is nothing to recover")
        reason = "it is damaged" if salvage.complete else "its writer did not close it"
        writer.close(complete=False, ending=f"recovered from {source.name}: {reason}")
    notes = tuple(dict.fromkeys(salvage.notes))
    return Recovered(target, samples, n_events, damaged, lost_values, salvage.format_version >= 2, notes)


def _copy_stream(
    stream: Stream,
    stated: Sequence[DamagedRows],
    writer: RecordingWriter,
    file_size: int,
    report: Callable[[str, int], None],
) -> tuple[DamagedRows, ...]:
    """Copy the undamaged rows of a stream, with NaN for damaged rows between them; return the damaged rows.

    ``stated`` are the rows that were missing in the recording already.
    """
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
            for piece, reason in _by_reason(rows, written, stated):
                writer.append_with_missing(stream.name, piece, reason)
        written += len(rows)
        report(stream.name, written)
    return _merged(damaged)


def _by_reason(rows: Real, first: int, stated: Sequence[DamagedRows]) -> list[tuple[Real, str]]:
    """Divide rows, of which some are not finite, where the reason changes; ``first`` is the number of the first."""
    reasons = [_UNSTATED, *(span.reason for span in stated)]
    numbers = np.zeros(len(rows), dtype=int)
    for number, span in enumerate(stated, 1):
        if span.first < first + len(rows) and span.end > first:
            numbers[max(span.first - first, 0) : span.end - first] = number
    missing = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    changes = [0, *(missing[1:][np.diff(numbers[missing]) != 0]), len(rows)]
    return [(rows[start:end], reasons[numbers[missing[missing < end][-1]]]) for start, end in pairwise(changes)]


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
