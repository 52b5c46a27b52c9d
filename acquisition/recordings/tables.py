"""Tables of a recording file: created empty, extended row by row, each row or block with its checksum."""

import contextlib
import secrets
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import DiskError, DiskFull, FileFormatError, InputError, Real, command, is_disk_full

from ..sources.source import TEXT_BYTES, EventAxis, StreamDescription
from .chunk_places import ChunkPlaces
from .durability import SpareSpace, abandon, failure_of_hdf5
from .journal import JOURNAL_CHUNK, Frame, Journal, block_frames, row_frames, text_frames
from .recording_format import (
    ENDING_BYTES,
    ENTRY,
    MISSING,
    MISSING_COLUMNS,
    block_entries,
    missing_sums,
    read_table,
    row_sums,
    text_attribute,
)
from .stated_texts import stated_texts

SLOW_ROWS = 1024  # rows in a chunk of clock pairs and events
BLOCK_ENTRIES = 512  # entries in a chunk: it is written again with each block, and many small chunks have a large index
Tables = Mapping[str, h5py.Dataset]  # of one group, by name; kept open, because looking them up takes long
Columns = tuple[Real, Real, Real | None]


@dataclass(frozen=True)
class NewRows:
    """New rows of several tables, and the frames of the journal that describe them.

    Parameters
    ----------
    tables
        Tables and their new rows, which are written in this order.
    frames
        Makes the frames after the rows were written.
    """

    tables: list[tuple[h5py.Dataset, NDArray[np.generic]]]
    frames: Callable[[], list[Frame]]


# With pages of 4096 bytes, the metadata of a small table lie in one page, which a failing disk writes as a whole or not
# at all (docs/decisions/0021-checked-recordings.md).
PAGE = 4096


def empty_recording(
    path: Path,
    streams: Sequence[StreamDescription],
    event_axes: Mapping[str, EventAxis],
    texts: Mapping[str, str],
    dtype: str,
    block_length: int,
) -> tuple[h5py.File, Journal]:
    """Create a recording with all its tables, which are empty, and return the open file and its journal.

    It must not be closed and opened again before samples are written: the pages would be divided otherwise.
    """
    file = h5py.File(path, "w", libver="latest", fs_strategy="page", fs_page_size=PAGE)
    try:
        stated = stated_texts(streams, event_axes, texts, dtype, block_length)
        for stream in streams:
            _make_stream(file, stream, dtype, block_length)
        for name, axis in event_axes.items():
            _make_events(file, name, axis)
        for place, attributes in stated["attributes"].items():
            file[place].attrs.update(attributes)
        file.attrs["complete"] = np.bool_(False)
        file.attrs["ending"] = np.array(b"", f"S{ENDING_BYTES}")
        file.create_dataset("journal", (0,), "u1", maxshape=(None,), chunks=(JOURNAL_CHUNK,))
        journal = Journal(file["journal"], secrets.token_bytes(8))
        journal.append(text_frames(stated))
    except (OSError, RuntimeError):
        abandon(file)
        raise
    except BaseException:
        file.close()
        raise
    return file, journal


def _make_stream(file: h5py.File, stream: StreamDescription, dtype: str, block_length: int) -> None:
    """Create the group of a stream with empty tables; ``block_length`` is the number of rows in a chunk of samples."""
    group = file.create_group(f"signals/{stream.name}")
    width = len(stream.channels)
    group.create_dataset("samples", (0, width), dtype, maxshape=(None, width), chunks=(block_length, width))
    group.create_dataset("blocks", (0,), ENTRY, maxshape=(None,), chunks=(BLOCK_ENTRIES,))
    group.create_dataset("missing", (0,), MISSING, maxshape=(None,), chunks=(BLOCK_ENTRIES,))
    group.create_dataset("clock", (0, 2), "f8", maxshape=(None, 2), chunks=(SLOW_ROWS, 2))
    group.create_dataset("clock_sum", (0,), "<u4", maxshape=(None,), chunks=(SLOW_ROWS,))


def _make_events(file: h5py.File, name: str, axis: EventAxis) -> None:
    """Create the group of a series of events with empty tables."""
    group = file.create_group(f"events/{name}")
    for column in event_columns(axis):
        dtype = f"S{TEXT_BYTES}" if column == "text" else "f8"
        group.create_dataset(column, (0,), dtype, maxshape=(None,), chunks=(SLOW_ROWS,))
    group.create_dataset("sum", (0,), "<u4", maxshape=(None,), chunks=(SLOW_ROWS,))


def event_columns(axis: EventAxis) -> tuple[str, ...]:
    """Return the names of the columns of a series, in the order of their checksum."""
    arrival = ("arrival",) if axis.kind == "device" else ()
    return ("time", "value", *arrival, *(("text",) if axis.texts else ()))


def sample_rows(tables: Tables, places: ChunkPlaces, samples: NDArray[np.floating]) -> NewRows:
    """Return new rows (n_samples, n_channels) for the table of a stream, and the entries of their blocks."""
    table, blocks = tables["samples"], tables["blocks"]
    stored, start, chunk_rows = np.asarray(samples, table.dtype), int(table.shape[0]), table.chunks[0]
    entries = block_entries(stored, start, blocks.shape[0], chunk_rows)
    places.note_end()
    return NewRows(
        [(table, stored), (blocks, entries)],
        lambda: block_frames(table.parent.name, entries, places.of(start, stored), chunk_rows),
    )


def missing_rows(tables: Tables, samples: NDArray[np.floating], reason: str) -> NewRows:
    """Return new entries of the table of missing rows, for rows of ``samples`` with NaN that will be appended next."""
    first = tables["samples"].shape[0]
    is_missing = np.concatenate([[False], ~np.isfinite(samples).all(axis=1), [False]])
    edges = np.flatnonzero(np.diff(is_missing.astype(np.int8)))
    text = " ".join(reason.split()).encode()[: MISSING["reason"].itemsize]
    rows = np.array([(first + start, end - start, text, 0) for start, end in edges.reshape(-1, 2)], MISSING)
    start = int(tables["missing"].shape[0])
    rows["sum"] = missing_sums(rows, start)
    columns = [rows[name] for name in MISSING_COLUMNS]
    return NewRows([(tables["missing"], rows)], lambda: row_frames(tables["missing"].name, start, columns))


def summed_rows(tables: Tables, columns: Mapping[str, NDArray[np.generic]], sums: str) -> NewRows:
    """Return new rows of clock pairs or events by the name of their column, and checksums in the column ``sums``."""
    stored = [np.asarray(values, tables[name].dtype) for name, values in columns.items()]
    start = int(tables[sums].shape[0])
    checksums = row_sums(stored, start)
    return NewRows(
        list(zip((tables[name] for name in (*columns, sums)), (*stored, checksums), strict=True)),
        lambda: row_frames(tables[sums].name, start, stored),
    )


def append_rows(new: NewRows, journal: Journal, spare: SpareSpace | None, path: object) -> None:
    """Append rows to several tables and their frames to the journal, and hand all data to the operating system."""
    lengths, journal_length = [table.shape[0] for table, _ in new.tables], journal.length
    try:
        for (table, rows), length in zip(new.tables, lengths, strict=True):
            end = length + len(rows)
            table.resize((end, *table.shape[1:]))
            table[length:end] = rows
            table.flush()
        journal.append(new.frames())
    except BaseException as error:
        # Rows that were announced but not written would be read as zeros. Whatever interrupts, Ctrl-C included, the
        # tables get back their length. On a full disk this needs the spare space.
        full = is_disk_full(error)
        if full and spare is not None:
            spare.release()
        with contextlib.suppress(OSError, RuntimeError):
            for (table, _), length in zip(new.tables, lengths, strict=True):
                table.resize(length, axis=0)
                table.flush()
            journal.cut(journal_length)
        if full:
            text = f"the disk of {path} is full; the recording ends here, make room for the next one"
            raise DiskFull(text) from error
        if not isinstance(error, OSError | RuntimeError):
            raise
        reason = failure_of_hdf5(error)
        raise DiskError(
            f"the disk of {path} failed ({reason}); the recording ends here, check the disk before the next one"
        ) from error


@dataclass(frozen=True)
class TableRows:
    """Rows of clock pairs or events, and which of them match their checksums.

    Parameters
    ----------
    columns : (n_rows, ...) each
        Values of each column.
    valid : (n_rows,)
        Whether each row matches its checksum.
    """

    columns: list[NDArray[np.generic]]
    valid: NDArray[np.bool_]

    @property
    def sound(self) -> list[NDArray[np.generic]]:
        """Return the columns of the valid rows."""
        return [column[self.valid] for column in self.columns]

    @property
    def damaged(self) -> int:
        """Return the number of rows that do not match their checksums."""
        return int(len(self.valid) - self.valid.sum())


def read_rows(group: h5py.Group, columns: Sequence[str], sums: str, *, skip_damaged: bool = False) -> TableRows:
    """Read the rows of clock pairs or events, and compare them with their checksums.

    Rows that are in some columns only were never acknowledged. A file of version 1 has no checksums: all rows pass.
    With ``skip_damaged``, rows that cannot be read count as damaged, too, if there are checksums.
    """
    try:
        has_sums = group.file.attrs["format_version"] >= 2  # a damaged table of sums is not "in" the group
        skips = skip_damaged and has_sums
        stored = [read_table(group[name], skip_unreadable=skips) for name in columns]
        checksums = read_table(group[sums], skip_unreadable=skips) if has_sums else None
    except (OSError, RuntimeError, KeyError, AttributeError, TypeError, ValueError) as error:
        raise FileFormatError(
            f"{group.file.filename}: {group.name} lacks readable {' and '.join(map(repr, columns[:2]))}; "
            "record it again"
        ) from error
    count = min([*map(len, stored), *([] if checksums is None else [len(checksums)])])
    stored = [column[:count] for column in stored]
    valid = np.ones(count, dtype=bool) if checksums is None else row_sums(stored) == checksums[:count]
    return TableRows(stored, valid)


class EventSeries:
    """Times and values of one series of events in an open recording; they are read on request.

    ``align`` gives the times on the samples' axis and the values; without it the stored times are used. With
    ``skip_damaged`` values that do not match their checksums are left out instead of refusing the series.
    """

    def __init__(
        self, group: h5py.Group, align: Callable[[], tuple[Real, Real]] | None = None, *, skip_damaged: bool = False
    ) -> None:
        self._group = group
        self._align = align
        self._skip_damaged = skip_damaged

    def aligned(self, align: Callable[[], tuple[Real, Real]]) -> "EventSeries":
        """Return the series with times on the samples' axis, as ``align`` gives them."""
        return EventSeries(self._group, align, skip_damaged=self._skip_damaged)

    @property
    def axis(self) -> EventAxis:
        """Return the clock of the stored times."""
        try:
            kind = text_attribute(self._group.attrs, "time_axis", "samples")
            clock = text_attribute(self._group.attrs, "clock")
            texts = "text" in self._group
        except (OSError, RuntimeError, KeyError, ValueError) as error:
            raise FileFormatError(f"events {self._group.name} are damaged; take a copy of the file") from error
        try:
            return EventAxis(kind, clock, texts)  # type: ignore[arg-type]  # checked by EventAxis
        except InputError as error:
            raise FileFormatError(f"events {self._group.name}: {error}") from error

    @property
    def damaged(self) -> int:
        """Return the number of values that do not match their checksums."""
        return self.rows(event_columns(self.axis)).damaged

    def rows(self, columns: Sequence[str]) -> TableRows:
        """Read columns of the series, and which of their rows match their checksums."""
        return read_rows(self._group, columns, "sum", skip_damaged=self._skip_damaged)

    def _columns(self) -> list[NDArray[np.generic]]:
        rows = self.rows(event_columns(self.axis))
        if rows.damaged and not self._skip_damaged:
            raise FileFormatError(
                f"{self._group.file.filename}: {rows.damaged} values of {self._group.name} are damaged; save the sound "
                f"ones: {command('recover', self._group.file.filename)}"
            )
        return rows.sound

    def read_raw(self) -> Columns:
        """Read times in the clock of `axis` (s), values, and the host's arrival times (s) or None, each (n_events,)."""
        has_arrivals = self.axis.kind == "device"
        columns = self._columns()[: 3 if has_arrivals else 2]
        try:
            times, values, *arrivals = (np.asarray(column, dtype=float) for column in columns)
        except (TypeError, ValueError) as error:
            raise FileFormatError(
                f"events {self._group.name} hold something that is no number; record it again"
            ) from error
        return times, values, arrivals[0] if arrivals else None

    def read_texts(self) -> tuple[str, ...]:
        """Return the text of each value; empty texts if the series has none."""
        columns = self._columns()
        if not self.axis.texts:
            return ("",) * len(columns[0])
        try:
            return tuple(bytes(text).decode("utf-8", "replace") for text in columns[-1])
        except (TypeError, ValueError) as error:
            raise FileFormatError(f"events {self._group.name} have no readable 'text'; record it again") from error

    def read(self) -> tuple[Real, Real]:
        """Read times on the samples' axis (s) and values, each (n_events,)."""
        return self.read_raw()[:2] if self._align is None else self._align()
