"""Tables of a recording file: created empty, grown row by row, each row or block with its checksum."""

import contextlib
import json
from collections.abc import Callable, Mapping, Sequence

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import DiskFull, FileFormatError, InputError, is_disk_full

from ..sources.source import TEXT_BYTES, EventAxis, StreamDescription
from .durability import SpareSpace
from .recording_format import ENTRY, entries_of, row_sums, text_attribute

Rows = Sequence[tuple[h5py.Dataset, NDArray[np.generic]]]


def append_rows(rows: Rows, spare: SpareSpace | None, path: object) -> None:
    """Append to several tables and hand everything to the system.

    Rows that were announced but not written must not be read as zeros: whatever interrupts, Ctrl-C included, the tables
    get back the length they had. When the disk is full the spare space is released first, so that this succeeds.

    Raises
    ------
    DiskFull
        The rows may not have been kept; the tables are whole, and nothing more can be appended.
    """
    lengths = [table.shape[0] for table, _ in rows]
    try:
        for table, new in rows:
            _extend(table, new)
    except BaseException as error:
        full = is_disk_full(error)
        if full and spare is not None:
            spare.release()
        with contextlib.suppress(OSError, RuntimeError):
            for (table, _), length in zip(rows, lengths, strict=True):
                table.resize(length, axis=0)
                table.flush()
        if not full:
            raise
        raise DiskFull(f"the disk of {path} is full; the recording ends here, make room for the next one") from error


def _extend(table: h5py.Dataset, new: NDArray[np.generic]) -> None:
    start = table.shape[0]
    table.resize(start + len(new), axis=0)
    table[start:] = new
    table.flush()


SLOW_ROWS = 1024
"""Rows in a chunk of clock pairs and events."""

ENTRIES = 512
"""Entries of blocks in a chunk: it is written anew with each block, and many small chunks have a large index."""

MISSING = np.dtype([("first_row", "<u8"), ("rows", "<u8"), ("reason", "S120")])
"""Rows of a stream that are missing; their samples are NaN."""

Real = NDArray[np.floating]
Tables = Mapping[str, h5py.Dataset]
"""Tables of one group by name, held open: looking them up takes longer than a block's checksum."""


def make_stream(file: h5py.File, stream: StreamDescription, dtype: str, block_length: int) -> Tables:
    """Make the group of a stream, with empty tables.

    Parameters
    ----------
    file
        File open for writing.
    stream
        Name, rate and channels.
    dtype
        ``float32`` or ``float64``.
    block_length
        Rows in a chunk of samples.
    """
    group = file.create_group(f"signals/{stream.name}")
    group.attrs["sample_rate"] = float(stream.sample_rate)
    group.attrs["start_time"] = float(stream.start_time)
    group.attrs["channels"] = json.dumps([channel.to_json() for channel in stream.channels])
    width = len(stream.channels)
    group.create_dataset("samples", (0, width), dtype, maxshape=(None, width), chunks=(block_length, width))
    group.create_dataset("blocks", (0,), ENTRY, maxshape=(None,), chunks=(ENTRIES,))
    group.create_dataset("missing", (0,), MISSING, maxshape=(None,), chunks=(ENTRIES,))
    group.create_dataset("clock", (0, 2), "f8", maxshape=(None, 2), chunks=(SLOW_ROWS, 2))
    group.create_dataset("clock_sum", (0,), "<u4", maxshape=(None,), chunks=(SLOW_ROWS,))
    return dict(group.items())


def make_events(file: h5py.File, name: str, axis: EventAxis) -> Tables:
    """Make the group of a series of events, with empty columns.

    Parameters
    ----------
    file
        File open for writing.
    name
        Name of the series.
    axis
        Clock that tells the times, and whether there are texts.
    """
    group = file.create_group(f"events/{name}")
    group.attrs["time_axis"] = axis.kind
    group.attrs["clock"] = axis.clock
    for column in event_columns(axis):
        dtype = f"S{TEXT_BYTES}" if column == "text" else "f8"
        group.create_dataset(column, (0,), dtype, maxshape=(None,), chunks=(SLOW_ROWS,))
    group.create_dataset("sum", (0,), "<u4", maxshape=(None,), chunks=(SLOW_ROWS,))
    return dict(group.items())


def event_columns(axis: EventAxis) -> tuple[str, ...]:
    """Names of the columns of a series, in the order in which their checksum takes them."""
    arrival = ("arrival",) if axis.kind == "device" else ()
    return ("time", "value", *arrival, *(("text",) if axis.texts else ()))


def append_samples(tables: Tables, samples: Real, spare: SpareSpace | None, path: object) -> None:
    """Append rows to a stream, and then the checksums of their blocks.

    Parameters
    ----------
    tables
        Tables of the stream.
    samples : (n_samples, n_channels)
        Rows in SI units.
    spare
        Disk space to give back when the disk is full.
    path
        Path of the file, for messages.

    Raises
    ------
    DiskFull
        No room is left.
    """
    table, blocks = tables["samples"], tables["blocks"]
    stored = np.asarray(samples, table.dtype)
    entries = entries_of(stored, table.shape[0], blocks.shape[0])
    append_rows([(table, stored), (blocks, entries)], spare, path)


def append_missing(tables: Tables, samples: Real, reason: str, spare: SpareSpace | None, path: object) -> None:
    """Append rows to a stream of which some are missing, NaN, and say which and why.

    Parameters
    ----------
    tables
        Tables of the stream.
    samples : (n_samples, n_channels)
        Rows in SI units; a row that holds NaN is missing.
    reason
        Why rows are missing, in a few words.
    spare
        Disk space to give back when the disk is full.
    path
        Path of the file, for messages.

    Raises
    ------
    DiskFull
        No room is left.
    """
    first, table = tables["samples"].shape[0], tables["missing"]
    gone = np.concatenate([[False], ~np.isfinite(samples).all(axis=1), [False]])
    edges = np.flatnonzero(np.diff(gone.astype(np.int8)))
    append_samples(tables, samples, spare, path)
    text = " ".join(reason.split()).encode()[: MISSING["reason"].itemsize]
    rows = [(first + a, b - a, text) for a, b in edges.reshape(-1, 2)]
    append_rows([(table, np.array(rows, MISSING))], spare, path)


def append_summed(
    tables: Tables,
    columns: Sequence[str],
    sums: str,
    rows: Sequence[NDArray[np.generic]],
    spare: SpareSpace | None,
    path: object,
) -> None:
    """Append rows of slow values, and then their checksums.

    Parameters
    ----------
    tables
        Tables that hold the columns.
    columns
        Names of the columns.
    sums
        Name of the column of checksums.
    rows
        New rows of each column.
    spare
        Disk space to give back when the disk is full.
    path
        Path of the file, for messages.

    Raises
    ------
    DiskFull
        No room is left.
    """
    stored = [np.asarray(new, tables[name].dtype) for name, new in zip(columns, rows, strict=True)]
    checks = row_sums(stored, tables[sums].shape[0])
    grown = [tables[name] for name in (*columns, sums)]
    append_rows(list(zip(grown, (*stored, checks), strict=True)), spare, path)


def summed_rows(group: h5py.Group, columns: Sequence[str], sums: str) -> tuple[list[NDArray[np.generic]], int]:
    """Rows of slow values that match their checksums, and how many do not.

    Rows that are in some columns only were never acknowledged. A file of version 1 has no checksums: all are taken.

    Parameters
    ----------
    group
        Group that holds the columns.
    columns
        Names of the columns.
    sums
        Name of the column of checksums.

    Raises
    ------
    FileFormatError
        A column is not there or cannot be read.
    """
    try:
        stored = [np.asarray(group[name][:]) for name in columns]
        checks = np.asarray(group[sums][:]) if sums in group else None
    except (OSError, RuntimeError, KeyError, AttributeError, TypeError, ValueError) as error:
        raise FileFormatError(
            f"{group.file.filename}: {group.name} lacks readable {' and '.join(map(repr, columns[:2]))}; record anew"
        ) from error
    count = min([*map(len, stored), *([] if checks is None else [len(checks)])])
    stored = [column[:count] for column in stored]
    if checks is None:
        return stored, 0
    good = row_sums(stored) == checks[:count]
    return [column[good] for column in stored], int(count - good.sum())


Pair = tuple[NDArray[np.float64], NDArray[np.float64]]
Columns = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64] | None]


class EventSeries:
    """Slow or asynchronous values: times and values, read when asked for.

    Parameters
    ----------
    group
        The HDF5 group ``/events/<name>``.
    aligned
        Function that gives the times on the samples' axis and the values; None: the stored times are taken as they are.
    sound_only
        Leave out values that do not match their checksums instead of refusing the series.
    """

    def __init__(
        self, group: h5py.Group, aligned: Callable[[], Pair] | None = None, *, sound_only: bool = False
    ) -> None:
        self._group = group
        self._aligned = aligned
        self._sound_only = sound_only

    @property
    def axis(self) -> EventAxis:
        """Clock in which the stored times are told.

        Raises
        ------
        FileFormatError
            The file names none that is known.
        """
        try:
            defaults = (("time_axis", "samples"), ("clock", ""))
            kind, clock = (text_attribute(self._group.attrs, name, default) for name, default in defaults)
            texts = "text" in self._group
        except (OSError, RuntimeError, KeyError, ValueError) as error:
            raise FileFormatError(f"events {self._group.name} are damaged; take a copy of the file") from error
        try:
            return EventAxis(kind, clock, texts)  # type: ignore[arg-type]  # checked by EventAxis
        except InputError as error:
            raise FileFormatError(f"events {self._group.name}: {error}") from error

    def read_raw(self) -> Columns:
        """Times in the clock of `axis` (s), values, and the host's arrival times (s) or None, each (n_events,).

        Raises
        ------
        FileFormatError
            The series is damaged.
        """
        times, values, *others = (np.asarray(one, dtype=float) for one in self._sound()[: 3 if self._arrives else 2])
        return times, values, others[0] if others else None

    @property
    def damaged(self) -> int:
        """Number of values that do not match their checksums."""
        return summed_rows(self._group, event_columns(self.axis), "sum")[1]

    @property
    def _arrives(self) -> bool:
        return self.axis.kind == "device"

    def _sound(self) -> list[NDArray[np.generic]]:
        """Columns of the rows that match their checksums."""
        columns, damaged = summed_rows(self._group, event_columns(self.axis), "sum")
        if damaged and not self._sound_only:
            raise FileFormatError(
                f"{self._group.file.filename}: {damaged} values of {self._group.name} are damaged; save the sound ones "
                "with millfrf recover"
            )
        return columns

    def read_texts(self) -> tuple[str, ...]:
        """The text of each value; empty texts where the series has none.

        Raises
        ------
        FileFormatError
            The series is damaged.
        """
        columns = self._sound()
        if not self.axis.texts:
            return ("",) * len(columns[0])
        try:
            return tuple(bytes(text).decode("utf-8", "replace") for text in columns[-1])
        except (TypeError, ValueError) as error:
            raise FileFormatError(f"events {self._group.name} have no readable 'text'; record anew") from error

    def read(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times on the samples' axis (s) and values, each (n_events,).

        Raises
        ------
        FileFormatError
            The series is damaged, or its clock cannot be aligned.
        """
        return self.read_raw()[:2] if self._aligned is None else self._aligned()
