"""Everything that can be read of a damaged recording: from its raw bytes, and from HDF5's tables."""

import json
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path
from types import TracebackType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, Real

from ..sources.source import TEXT_BYTES, EventAxis, Events, StreamDescription
from .carving import RawSamples, carve
from .journal import Frame, block_of, chunks_of, table_number
from .recording import Recording
from .recording_format import ENTRY, MISSING, MISSING_COLUMNS, BlockTable, Entries, stream_from_attributes
from .stream import CheckedSamples, DamagedRows, DamagedSamplesError, Stream, stated_missing
from .tables import EventSeries, TableRows, event_columns

Value = TypeVar("Value")
_CLOCK = [np.dtype(("<f8", (2,)))]  # columns of clock pairs


class Salvage:
    """A damaged recording, opened for recovery; use it in a ``with`` block.

    Each stream and each series is read on its own: from its frames in the raw bytes, if the file is of version 3, and
    from HDF5's tables where they can be read.

    Raises
    ------
    FileFormatError
        Neither HDF5 nor the journal tells what was recorded.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.notes: list[str] = []  # damage of other things than samples and values, a line each
        with ExitStack() as stack:
            self._file = stack.enter_context(path.open("rb"))
            self._carved = carve(self._file, path.stat().st_size)
            self._recording = self._opened(stack)
            self._stack = stack.pop_all()

    def _opened(self, stack: ExitStack) -> Recording | None:
        """Open the recording with HDF5, and note why it cannot be opened as an undamaged one."""
        try:
            with Recording(self.path) as recording:
                for name in recording.streams:
                    recording.missing(name)
        except DamagedSamplesError:
            pass  # these are counted as samples
        except FileFormatError as error:
            self.notes.append(str(error).partition(";")[0])
        try:
            return stack.enter_context(Recording(self.path, accept_cut=True))
        except FileFormatError:
            if self._carved is None or self._carved.texts is None:
                raise
        return None

    def __enter__(self) -> "Salvage":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    @property
    def _texts(self) -> dict[str, Any] | None:
        return self._carved.texts if self._carved is not None else None

    @property
    def format_version(self) -> int:
        """Return the version of the file's format."""
        return self._recording.format_version if self._carved is None and self._recording is not None else 3

    @property
    def complete(self) -> bool:
        """Return whether the recording was closed in order."""
        if self._recording is not None:
            return bool(self._recording.complete)
        return self._carved is not None and bool(self._carved.end["complete"])

    def text(self, name: str) -> str:
        """Return title, recorded_at, setup or provenance: the copy if there is one, else what the file states."""
        if self._texts is not None:
            return str(self._texts["attributes"]["/"][name])
        return str(getattr(self._recording, name))

    @property
    def streams(self) -> dict[str, Stream]:
        """Return the streams by name."""
        if self._texts is None:
            held = {} if self._recording is None else self._recording.streams
            return {name: self._stream(name, stream.description) for name, stream in held.items()}
        names = [place.removeprefix("/signals/") for place in self._texts["tables"] if place.startswith("/signals/")]
        return {name: self._stream(name, self._description(name)) for name in names}

    def _description(self, name: str) -> StreamDescription:
        assert self._texts is not None
        attributes = self._texts["attributes"][f"/signals/{name}"]
        return stream_from_attributes(name, attributes, len(json.loads(attributes["channels"])), self.path)

    def _stream(self, name: str, description: StreamDescription) -> Stream:
        """Return a stream that reads the raw bytes where its blocks have frames."""
        held = self._recording.streams.get(name) if self._recording is not None else None
        if self._carved is None:
            assert held is not None
            return held
        place, dataset = f"/signals/{name}", held.samples.dataset if held is not None else None
        if self._texts is not None:
            dtype, chunk_rows = (self._texts["tables"][place][key] for key in ("dtype", "chunk_rows"))
        else:
            assert dataset is not None
            dtype, chunk_rows = dataset.dtype, dataset.chunks[0]
        frames = self._carved.blocks[table_number(place)]
        table = held.samples.table if held is not None else None
        entries = _merged_entries(table.entries if table is not None else np.empty(0, ENTRY), frames)
        addresses: dict[int, int] = {}
        for frame in frames:
            numbers = chunks_of(frame.first, frame.first + frame.rows, chunk_rows)
            addresses |= zip(numbers, block_of(frame)[1].tolist(), strict=True)
        n_rows = max([dataset.shape[0] if dataset is not None else 0, *(frame.first + frame.rows for frame in frames)])
        shape = n_rows, len(description.channels)
        samples = RawSamples(self._file, addresses, shape, np.dtype(dtype), chunk_rows, dataset)
        return Stream(description, CheckedSamples(samples, BlockTable(entries), name, self.path), self.path)

    def note_unreadable(self, name: str) -> None:
        """Note the samples of a stream that HDF5 does not give, although their bytes may be sound."""
        held = self._recording.streams.get(name) if self._recording is not None else None
        parts = [] if held is None else held.recovered_parts(self.path.stat().st_size)
        lost = sum(part.end - part.first for part in parts if isinstance(part, DamagedRows))
        if lost:
            self.notes.append(f"{lost} samples of {name} cannot be read with HDF5")

    def clock_pairs(self, stream: str) -> tuple[Real, int]:
        """Return the sound clock pairs of a stream, (n_pairs, 2), and the number of damaged ones."""
        (pairs,), damaged = self._merged(
            f"/signals/{stream}/clock_sum", _CLOCK, f"clock of {stream}", lambda recording: recording.clock_rows(stream)
        )
        return np.asarray(pairs, dtype=float).reshape(-1, 2), damaged

    def missing(self, stream: str) -> tuple[DamagedRows, ...]:
        """Return the rows of a stream that are missing in the recording itself, with the reasons that it states."""
        dtypes = [MISSING[name] for name in MISSING_COLUMNS]
        what, place = f"missing samples of {stream}", f"/signals/{stream}/missing"
        return stated_missing(self._merged(place, dtypes, what, lambda recording: recording.missing_rows(stream))[0])

    @cached_property
    def event_axes(self) -> dict[str, EventAxis]:
        """Return the clock of each series of events by name."""
        if self._texts is None:
            axes = {name: self._read(f"events {name}", _axis_of(series)) for name, series in self._series.items()}
            return {name: axis for name, axis in axes.items() if axis is not None}
        places = {place: table for place, table in self._texts["tables"].items() if place.startswith("/events/")}
        attributes = self._texts["attributes"]
        return {
            place.removeprefix("/events/"): EventAxis(
                attributes[place]["time_axis"], attributes[place]["clock"], table["texts"]
            )
            for place, table in places.items()
        }

    @cached_property
    def _series(self) -> dict[str, EventSeries]:
        damaged = self._read("events", lambda recording: recording.damaged_events) or []
        self.notes += [f"the header of events {name} is damaged" for name in damaged]
        return self._read("events", lambda recording: recording.raw_events()) or {}

    def events(self, name: str) -> tuple[Events, int]:
        """Return the sound values of a series and the number of damaged ones."""
        axis = self.event_axes[name]
        names = event_columns(axis)
        dtypes = [np.dtype(f"S{TEXT_BYTES}" if column == "text" else "<f8") for column in names]
        series = self._series.get(name)
        columns, damaged = self._merged(
            f"/events/{name}/sum", dtypes, f"events {name}", lambda _: None if series is None else series.rows(names)
        )
        held = dict(zip(names, columns, strict=True))
        texts = tuple(bytes(text).decode("utf-8", "replace") for text in held.get("text", ()))
        times, values = (np.asarray(held[key], dtype=float) for key in ("time", "value"))
        arrivals = np.asarray(held["arrival"], dtype=float) if axis.kind == "device" else None
        return Events(name, times, values, arrivals, texts if axis.texts else None), damaged

    def _read(self, what: str, read: "Callable[[Recording], Value | None]") -> "Value | None":
        """Read something with HDF5; None, and a note, if that fails."""
        if self._recording is None:
            return None
        try:
            return read(self._recording)
        except FileFormatError as error:
            self.notes.append(f"{what}: {str(error).partition(';')[0]}")
            return None

    def _merged(
        self,
        place: str,
        dtypes: Sequence["np.dtype[np.generic]"],
        what: str,
        read: "Callable[[Recording], TableRows | None]",
    ) -> tuple[list[NDArray[np.generic]], int]:
        """Return the sound rows of a table, column by column, from HDF5 and from frames; and the number of others."""
        held = self._read(what, read)
        frames = self._carved.rows[table_number(place)] if self._carved is not None else []
        count = max([0 if held is None else len(held.valid), *(frame.first + frame.rows for frame in frames)])
        columns, known = [np.zeros(count, dtype) for dtype in dtypes], np.zeros(count, dtype=bool)
        if held is not None:
            places = np.flatnonzero(held.valid)
            known[places] = True
            for column, stored in zip(columns, held.columns, strict=True):
                column[places] = stored[places]
        for frame in frames:
            _put(frame, columns)
            known[frame.first : frame.first + frame.rows] = True
        if held is not None and (repaired := held.damaged - int((~known[: len(held.valid)]).sum())):
            self.notes.append(f"{repaired} values of {what} are damaged, and were taken from the journal")
        return [column[known] for column in columns], int(count - known.sum())


def _axis_of(series: EventSeries) -> "Callable[[Recording], EventAxis]":
    return lambda _: series.axis


def _put(frame: Frame, columns: Sequence[NDArray[np.generic]]) -> None:
    """Copy the rows of a frame to their places in the columns."""
    at = 0
    for column in columns:
        part = column[frame.first : frame.first + frame.rows]
        part[...] = np.frombuffer(frame.payload, part.dtype, part.size, at).reshape(part.shape)
        at += part.nbytes


def _merged_entries(held: Entries, frames: Sequence[Frame]) -> Entries:
    """Return the entries of all blocks, each from its frame if there is one, else from the table of blocks."""
    framed = [block_of(frame)[0] for frame in frames]
    entries = np.zeros(max([len(held), *(int(entry["number"]) + 1 for entry in framed)]), ENTRY)
    entries[: len(held)] = held
    for entry in framed:
        entries[int(entry["number"])] = entry
    return entries
