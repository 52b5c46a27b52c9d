"""`Recording`: a recording file opened for reading; samples are read in blocks, never all at once."""

import os
import shutil
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, cast

import h5py
import numpy as np

from millfrf.core import FileFormatError, InputError, Real, Summary, command, counted, writing_whole_file
from millfrf.core.argument_types import checked_type
from millfrf.core.file_locks import is_being_written
from millfrf.core.hdf5_files import require_backed
from millfrf.core.steps import check_output

from .alignment import Alignment
from .arrays import Channels, Signals, TemporaryFolder, write_arrays, write_bytes
from .guarded_reading import open_for_reading, reporting_damage, require_stored
from .recording_format import (
    MISSING,
    MISSING_COLUMNS,
    BlockTable,
    check_format,
    missing_sums,
    read_table,
    stream_from_attributes,
    text_attribute,
)
from .stated_texts import require_stated
from .stream import CheckedSamples, DamagedRows, Stream, stated_missing
from .tables import EventSeries, TableRows, read_rows
from .unclosed_file import is_marked_as_written

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


class Recording:
    """A recording opened for reading; use it in a ``with`` block.

    Parameters
    ----------
    path
        HDF5 file of format ``millfrf.recording``, version 1 to 3.
    accept_cut
        Open a file that is damaged or ends before its samples do, and leave out what is damaged. For recovery.

    Raises
    ------
    FileFormatError
        Not HDF5, another format or version, or a field is missing or damaged.
    InputError
        No such file.
    """

    def __init__(self, path: str | os.PathLike[str], *, accept_cut: bool = False) -> None:
        self.path = Path(_checked(path))
        self.folder: TemporaryFolder | None = None
        self._accept_cut = accept_cut
        # before this reader opens the file and holds a lock, too
        self._locked = self.path.is_file() and is_being_written(self.path)
        self._file = open_for_reading(self.path, accept_cut=accept_cut)
        try:
            with reporting_damage(self.path):
                check_format(self._file.attrs, self.path)
                if not accept_cut:
                    require_backed(self._file, self.path, checked_elsewhere="samples")
                if self.format_version >= 3 and not accept_cut:
                    require_stated(self._file, self.path, is_open=self._locked or is_marked_as_written(self.path))
                self.streams: Mapping[str, Stream] = self._open_streams()
        except BaseException:
            self._file.close()
            raise

    def _open_streams(self) -> dict[str, Stream]:
        groups = self._file.get("signals")
        if not isinstance(groups, h5py.Group) or not len(groups):
            raise FileFormatError(f"{self.path} holds no /signals; record or convert it again")
        # h5py holds its global lock while `items()` is iterated. An error in the loop would keep the iterator, and with
        # it the lock, as long as the traceback lives, and every other thread that uses h5py would wait for it.
        members = dict(groups.items())
        return {name: self._open_stream(name, group) for name, group in members.items()}

    def _open_stream(self, name: str, group: object) -> Stream:
        # Read the blocks before the samples: a running writer announces a block after its samples.
        has_blocks = self.format_version >= 2 and isinstance(group, h5py.Group)
        table = self._block_table(name, group) if has_blocks else None
        samples = group.get("samples") if isinstance(group, h5py.Group) else None
        if not isinstance(samples, h5py.Dataset) or samples.ndim != 2 or samples.dtype.kind != "f":
            raise FileFormatError(f"{self.path}: /signals/{name} has no table 'samples' of floats; convert it again")
        if not self._accept_cut:
            require_stored(samples, name, self.path)
        description = stream_from_attributes(name, group.attrs, samples.shape[1], self.path)  # type: ignore[attr-defined]
        checked = CheckedSamples(samples, table, name, self.path)
        if not self._accept_cut:
            checked.check_end()
        return Stream(description, checked, self.path)

    def _block_table(self, name: str, group: h5py.Group) -> BlockTable:
        return BlockTable.read(group.get("blocks"), name, self.path, skip_unreadable=self._accept_cut)

    @classmethod
    def from_arrays(
        cls,
        signals: Signals,
        rate: float,
        channels: Channels,
        *,
        name: str = "recording",
        title: str = "",
        setup: str = "",
        recorded_at: str = "",
        start_time: float = 0.0,
    ) -> "Recording":
        """Make a recording of arrays; every step takes it as it takes a file.

        The samples are in a temporary file, which is removed with the recording; :meth:`save` keeps a copy. A pickle
        holds all samples.

        Parameters
        ----------
        signals : (n_samples, n_channels), or a mapping of names to (n_samples,)
            Samples, also a table of pandas; arrays of pint have their units. Single precision is kept.
        rate : Hz
            Samples per second.
        channels
            For each channel, in the order of the columns, its name and in two words its unit and its place
            (``node:direction``): ``{"fx": "kN TCP:+X", "ax": "g HOUSING:+X", "speed": "rpm"}``. The unit says which
            quantity it is; samples are converted to SI units. Or a list of :class:`Channel`, whose samples are in SI
            units.
        name
            Name of the recording, for messages.
        title, setup
            Title of the recording; tool, cut and pose as TOML text.
        recorded_at
            Date, or date and time, of the recording in ISO 8601; empty: not known.
        start_time : s
            Time of the first sample.

        Raises
        ------
        InputError
            Signals that are no real numbers, that do not match their descriptions, or that hold NaN; an unknown unit.

        Examples
        --------
        >>> force, motion = np.zeros(1000), np.zeros(1000)
        >>> Recording.from_arrays({"fx": force, "ax": motion}, 500.0, {"fx": "N TCP:+X", "ax": "g TCP:+X"})
        Recording: recording.h5, 1 stream
          time of recording not known
          Stream main: 2 channels, 2 s at 500 Hz
          channels fx, ax
        """
        texts = {"title": title, "setup": setup, "recorded_at": recorded_at}
        return cls._temporary(name, partial(write_arrays, signals, rate, channels, start_time, texts))

    @classmethod
    def _temporary(cls, name: str, write: Callable[[Path], object]) -> "Recording":
        """Open a recording that ``write`` puts into a folder, which is removed with the recording and its streams."""
        folder = TemporaryFolder()
        path = folder.file(name)
        write(path)
        recording = cls(path)
        recording.folder = folder
        for stream in recording.streams.values():  # a stream may outlive the recording
            stream.folder = folder
        return recording

    @classmethod
    def _of_bytes(cls, name: str, content: bytes) -> "Recording":
        """Return the recording of a file's content, as a pickle holds it."""
        return cls._temporary(name, partial(write_bytes, content))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a copy of the recording's file; an existing file is replaced.

        Raises
        ------
        InputError
            A suffix other than ``.h5`` or ``.hdf5``, a folder that does not exist, or the file of the recording itself.
        """
        check_output(Path(_checked(path)), (".h5", ".hdf5"), (self.path,), "the file")
        with writing_whole_file(path) as temporary:
            shutil.copyfile(self.path, temporary)

    def __fspath__(self) -> str:
        return str(self.path)

    @property
    def closed(self) -> bool:
        """Return whether the file was closed."""
        return not self._file

    @property
    def format_version(self) -> int:
        """Return the version of the file's format: 1 has no checksums, 2 of samples and values, 3 of texts, too."""
        return int(self._file.attrs.get("format_version", 1))

    @property
    def title(self) -> str:
        """Return the title of the recording, possibly empty."""
        return self._text("title")

    @property
    def recorded_at(self) -> str:
        """Return the date, or date and time, of the recording in ISO 8601; empty if it is not known."""
        return self._text("recorded_at")

    @property
    def setup(self) -> str:
        """Return tool, cut and pose as TOML text."""
        return self._text("setup")

    @property
    def provenance(self) -> str:
        """Return the origin of the recording as JSON text; empty if the file does not state it."""
        return self._text("provenance")

    def _text(self, name: str) -> str:
        with reporting_damage(self.path):
            return text_attribute(self._file.attrs, name)

    @property
    def complete(self) -> bool | None:
        """Return whether the writer ended in order; None if the file does not state it."""
        value = self._file.attrs.get("complete")
        return None if value is None else bool(value)

    @property
    def being_written(self) -> bool:
        """Return whether a running writer held the file when it was opened; False if the system has no such locks."""
        return self._locked and self.complete is False

    @property
    def ending(self) -> str:
        """Return the error that ended the recording, one line; empty if it ended in order or its writer was killed."""
        return self._text("ending")

    @property
    def events(self) -> dict[str, EventSeries]:
        """Return the series of events by name, with times on the axis of the first stream."""
        return self.events_on(next(iter(self.streams)))

    def events_on(self, stream: str) -> dict[str, EventSeries]:
        """Return the series of events by name, with times on the axis of a stream.

        Offset and drift of all clocks are fitted.

        Raises
        ------
        InputError
            No such stream.
        """
        description = self.stream(stream).description
        with reporting_damage(self.path):
            raw = self.raw_events()
            alignment = Alignment(description, self.clock_pairs(stream), raw)
            return {name: series.aligned(partial(alignment.read, name)) for name, series in raw.items()}

    def raw_events(self) -> dict[str, EventSeries]:
        """Return the series of events by name, with times as they are stored."""
        damaged = self.damaged_events
        if damaged and not self._accept_cut:
            raise FileFormatError(
                f"{self.path}: events {', '.join(damaged)} are damaged; save the sound ones: "
                f"{command('recover', self.path)}"
            )
        return {
            name: EventSeries(group, skip_damaged=self._accept_cut)
            for name, group in self._event_groups().items()
            if name not in damaged
        }

    @property
    def damaged_events(self) -> list[str]:
        """Return the names of the series of events whose header cannot be read."""
        return [name for name, group in self._event_groups().items() if not isinstance(group, h5py.Group)]

    def _event_groups(self) -> dict[str, object]:
        with reporting_damage(self.path):
            events = self._file.get("events")
            return {} if events is None else dict(events.items())

    def clock_pairs(self, stream: str) -> Real:
        """Read the pairs (sample count, host's monotonic time in s) of a stream, (n_pairs, 2).

        Raises
        ------
        FileFormatError
            Some pairs do not match their checksums.
        """
        rows = self.clock_rows(stream)
        if rows.damaged and not self._accept_cut:
            raise FileFormatError(
                f"{self.path}: {rows.damaged} clock pairs of {stream} are damaged; save the sound ones: "
                f"{command('recover', self.path)}"
            )
        return np.asarray(rows.sound[0], dtype=float).reshape(-1, 2)

    def clock_rows(self, stream: str) -> TableRows:
        """Read the clock pairs of a stream, and which of them match their checksums."""
        with reporting_damage(self.path):
            group = self._file["signals"][stream]
            if self.format_version < 2 and "clock" not in group:
                return TableRows([np.empty((0, 2))], np.empty(0, dtype=bool))
            return read_rows(group, ["clock"], "clock_sum", skip_damaged=self._accept_cut)

    def missing(self, stream: str) -> tuple[DamagedRows, ...]:
        """Return which rows of a stream are missing (NaN) and why, as far as the file lists them."""
        rows = self.missing_rows(stream)
        if rows.damaged and not self._accept_cut:
            raise FileFormatError(
                f"{self.path}: the list of missing samples of {stream} is damaged; save the sound samples: "
                f"{command('recover', self.path)}"
            )
        return stated_missing(rows.sound)

    def missing_rows(self, stream: str) -> TableRows:
        """Read the list of missing rows of a stream, and which of its entries match their checksums."""
        with reporting_damage(self.path):
            if self.format_version < 2:
                return TableRows([np.empty(0, MISSING[name]) for name in MISSING_COLUMNS], np.empty(0, dtype=bool))
            entries = read_table(self._file["signals"][stream]["missing"], skip_unreadable=self._accept_cut)
            present = entries.dtype.names or ()
            if not set(MISSING_COLUMNS) <= set(present):  # an entry that cannot be read, so that the damage is reported
                return TableRows([np.zeros(1, MISSING[name]) for name in MISSING_COLUMNS], np.zeros(1, dtype=bool))
            valid = np.ones(len(entries), dtype=bool)
            if self.format_version >= 3:
                has_sums = "sum" in present  # not where the version itself is damaged
                valid = entries["sum"] == missing_sums(entries) if has_sums else ~valid
            return TableRows([entries[name] for name in MISSING_COLUMNS], valid)

    def stream(self, name: str | None = None) -> Stream:
        """Return the stream of that name; None returns the only stream.

        Raises
        ------
        InputError
            No such stream, or several streams and no name.
        """
        if name is None and len(self.streams) == 1:
            return next(iter(self.streams.values()))
        if name is None or name not in self.streams:
            mistake = "several streams" if name is None else f"no stream {name!r}"
            raise InputError(f"{self.path.name}: {mistake}; name one of {', '.join(self.streams)}")
        return self.streams[name]

    def close(self) -> None:
        """Close the file; streams can no longer be read."""
        self._file.close()

    def __enter__(self) -> "Recording":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def plot(self, axes: "Axes | None" = None, *, stream: str | None = None, **options: Any) -> "Axes":
        """Draw the channels of one stream and return the axes; see `draw_stream` for the options."""
        return self.stream(stream).plot(axes, **options)

    def to_xarray(self, stream: str | None = None) -> "xarray.DataArray":
        """Read all samples of one stream into an array; see :meth:`Stream.to_xarray`."""
        return self.stream(stream).to_xarray()

    def to_frame(self, stream: str | None = None) -> "pandas.DataFrame":
        """Read all samples of one stream into a table; see :meth:`Stream.to_frame`."""
        return self.stream(stream).to_frame()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Recording):
            return NotImplemented
        return self.path.resolve() == other.path.resolve()

    def __hash__(self) -> int:
        return hash(self.path.resolve())

    def __reduce__(self) -> tuple[Callable[..., "Recording"], tuple[Any, ...]]:
        if self.folder is not None:  # the file is gone where it is unpickled
            return self._of_bytes, (self.path.stem, self.path.read_bytes())
        # an open file cannot be pickled: the recording is opened again where it is unpickled
        return partial(Recording, accept_cut=self._accept_cut), (self.path,)

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()

    def _summary(self) -> Summary:
        if self.closed:
            return Summary(f"Recording: {self.path.name}, closed")
        state = "" if self.complete is True else ", not closed in order"
        streams = [stream.summary() for stream in self.streams.values()]
        about = [text for text in (self.title, self.recorded_at or "time of recording not known") if text]
        lines = [streams[0].headline, *streams[0].lines] if len(streams) == 1 else [s.headline for s in streams]
        if len(lines) > 2:
            lines = [lines[0], f"and {len(lines) - 1} more streams"]
        return Summary(
            f"Recording: {self.path.name}, {counted(len(self.streams), 'stream')}{state}",
            (", ".join(about), *lines),
            streams[0].columns,
            tuple(row for stream in streams for row in stream.rows),
        )


def _checked(path: str | os.PathLike[str]) -> str | os.PathLike[str]:
    return cast("str | Path", checked_type("path", path, str | os.PathLike, is_file=True))
