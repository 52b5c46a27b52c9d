"""`Recording`: a recording file opened for reading; samples are read in blocks, never as a whole."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, Summary, counted

from .alignment import Alignment
from .durability import is_being_written
from .guarded_reading import open_for_reading, reporting_damage, require_stored
from .recording_format import BlockTable, check_format, stream_from_attributes, text_attribute
from .stream import CheckedSamples, DamagedRows, Stream, block_table
from .tables import EventSeries, summed_rows

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


class Recording:
    """A recording opened for reading; use it in a ``with`` block.

    Parameters
    ----------
    path
        An HDF5 file of format ``millfrf.recording``, version 1 or 2.
    accept_cut
        Open a file that is damaged or ends before its samples do; what is not sound is left out. For recovery.

    Raises
    ------
    FileFormatError
        Not HDF5, another format or version, or a field is missing or damaged.
    InputError
        No such file.
    """

    def __init__(self, path: str | os.PathLike[str], *, accept_cut: bool = False) -> None:
        self.path = Path(path)
        self._accept_cut = accept_cut
        self._locked = self.path.is_file() and is_being_written(self.path)  # asked before this reader holds it, too
        self._file = open_for_reading(self.path, accept_cut=accept_cut)
        try:
            with reporting_damage(self.path):
                check_format(self._file.attrs, self.path)
                self.streams: Mapping[str, Stream] = self._find_streams()
        except BaseException:
            self._file.close()
            raise

    def _find_streams(self) -> dict[str, Stream]:
        group = self._file.get("signals")
        if not isinstance(group, h5py.Group) or not len(group):
            raise FileFormatError(f"{self.path} holds no /signals; record or convert anew")
        streams = {}
        for name, clock in group.items():
            # the blocks before the samples: a living writer announces a block when its samples are there
            table = self._table_of(name, clock)
            samples = clock.get("samples") if isinstance(clock, h5py.Group) else None
            if not isinstance(samples, h5py.Dataset) or samples.ndim != 2 or samples.dtype.kind != "f":
                raise FileFormatError(f"{self.path}: /signals/{name} has no table 'samples' of floats; convert anew")
            if not self._accept_cut:
                require_stored(samples, name, self.path)
            described = stream_from_attributes(name, clock.attrs, samples.shape[1], self.path)
            checked = CheckedSamples(samples, table, name, self.path)
            if not self._accept_cut:
                checked.require_whole_end()
            streams[name] = Stream(described, checked, self.path)
        return streams

    def _table_of(self, name: str, clock: object) -> BlockTable | None:
        """Checksums of a stream's samples; None in a file of version 1."""
        if self.format_version < 2 or not isinstance(clock, h5py.Group):
            return None
        return block_table(clock.get("blocks"), name, self.path)

    @property
    def format_version(self) -> int:
        """Version of the file's format: 2 has checksums, 1 has none."""
        return int(self._file.attrs.get("format_version", 1))

    @property
    def title(self) -> str:
        """Title, possibly empty."""
        return self._text("title")

    @property
    def recorded_at(self) -> str:
        """Date, or date and time, of the recording, ISO 8601; empty where it is not known."""
        return self._text("recorded_at")

    @property
    def setup(self) -> str:
        """Tool, cut and pose as TOML text."""
        return self._text("setup")

    @property
    def provenance(self) -> str:
        """Where the recording comes from, as JSON text; empty where the file does not say."""
        return self._text("provenance")

    def _text(self, name: str) -> str:
        with reporting_damage(self.path):
            return text_attribute(self._file.attrs, name)

    @property
    def complete(self) -> bool | None:
        """Whether the writer closed the file in order; None where the file does not say."""
        value = self._file.attrs.get("complete")
        return None if value is None else bool(value)

    @property
    def being_written(self) -> bool:
        """Whether a living writer held the file when it was opened (False where the system has no such locks)."""
        return self._locked and self.complete is False

    @property
    def ending(self) -> str:
        """How the recording ended, in one line; empty where it ended in order or its writer was killed."""
        return self._text("ending")

    @property
    def events(self) -> dict[str, EventSeries]:
        """Slow values by name; their times on the axis of the first stream."""
        return self.events_on(next(iter(self.streams)))

    def events_on(self, stream: str) -> dict[str, EventSeries]:
        """Slow values by name, their times on the axis of a stream: offset and drift of all clocks are fitted.

        Raises
        ------
        InputError
            No such stream.
        """
        described = self.stream(stream).description
        with reporting_damage(self.path):
            group = self._file.get("events")
            sound_only = self._accept_cut
            plain = (
                {} if group is None else {name: EventSeries(one, sound_only=sound_only) for name, one in group.items()}
            )
            alignment = Alignment(described, self.clock_pairs(stream), plain)
            return {
                name: EventSeries(group[name], partial(alignment.read, name), sound_only=sound_only) for name in plain
            }

    def clock_pairs(self, stream: str) -> NDArray[np.float64]:
        """Pairs (sample index, host monotonic time in s) of a stream, shape (n_pairs, 2).

        Raises
        ------
        FileFormatError
            Some do not match their checksums.
        """
        pairs, damaged = self._clock(stream)
        if damaged and not self._accept_cut:
            raise FileFormatError(
                f"{self.path}: {damaged} clock pairs of {stream} are damaged; save the sound ones with millfrf recover"
            )
        return pairs

    def damaged_clock_pairs(self, stream: str) -> int:
        """Number of clock pairs that do not match their checksums."""
        return self._clock(stream)[1]

    def _clock(self, stream: str) -> tuple[NDArray[np.float64], int]:
        """Sound clock pairs, and how many are damaged."""
        with reporting_damage(self.path):
            group = self._file["signals"][stream]
            if "clock" not in group:
                return np.empty((0, 2)), 0
            (pairs,), damaged = summed_rows(group, ["clock"], "clock_sum")
            return np.asarray(pairs, dtype=float).reshape(-1, 2), damaged

    def missing(self, stream: str) -> tuple[DamagedRows, ...]:
        """Rows of a stream that are missing (NaN), with the reason, as far as the file lists them."""
        with reporting_damage(self.path):
            listed = self._file["signals"][stream].get("missing")
            rows = [] if listed is None else list(listed[:])
            return tuple(
                DamagedRows(int(one[0]), int(one[0]) + int(one[1]), bytes(one[2]).decode("utf-8", "replace"))
                for one in rows
            )

    def stream(self, name: str | None = None) -> Stream:
        """The stream of that name; None asks for the only one.

        Raises
        ------
        InputError
            No such stream, or several and none named.
        """
        if name is None and len(self.streams) == 1:
            return next(iter(self.streams.values()))
        if name is None or name not in self.streams:
            asked = "several streams" if name is None else f"no stream {name!r}"
            raise InputError(f"{self.path.name}: {asked}; name one of {', '.join(self.streams)}")
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

    def plot(self, axes: "Axes | None" = None, *, stream: str | None = None, **choices: Any) -> "Axes":
        """Draw the channels of one stream and return the axes; see `draw_stream` for the choices."""
        return self.stream(stream).plot(axes, **choices)

    def to_xarray(self, stream: str | None = None) -> "xarray.DataArray":
        """All samples of one stream as an array; see :meth:`Stream.to_xarray`."""
        return self.stream(stream).to_xarray()

    def to_frame(self, stream: str | None = None) -> "pandas.DataFrame":
        """All samples of one stream as a table; see :meth:`Stream.to_frame`."""
        return self.stream(stream).to_frame()

    def __eq__(self, other: object) -> bool:
        """Whether both read the same file."""
        if not isinstance(other, Recording):
            return NotImplemented
        return self.path.resolve() == other.path.resolve()

    def __hash__(self) -> int:
        return hash(self.path.resolve())

    def __reduce__(self) -> tuple[Callable[..., "Recording"], tuple[Path]]:
        """Pickle the name of the file; the recording is opened anew where it is unpickled."""
        return partial(Recording, accept_cut=self._accept_cut), (self.path,)

    def __repr__(self) -> str:
        return self._summary().text()

    def _repr_html_(self) -> str:
        return self._summary().html()

    def _summary(self) -> Summary:
        if not self._file:
            return Summary(f"Recording: {self.path.name}, closed")
        state = "" if self.complete is True else ", not closed in order"
        parts = [stream.summary() for stream in self.streams.values()]
        when = self.recorded_at or "time of recording not known"
        said = [text for text in (self.title, when) if text]
        lines = [part.headline for part in parts] if len(parts) > 1 else [parts[0].headline, *parts[0].lines]
        if len(lines) > 2:
            lines = [lines[0], f"and {len(lines) - 1} more streams"]
        return Summary(
            f"Recording: {self.path.name}, {counted(len(self.streams), 'stream')}{state}",
            (*([", ".join(said)] if said else []), *lines),
            parts[0].columns,
            tuple(row for part in parts for row in part.rows),
        )


RecordingFile = str | os.PathLike[str] | Recording
"""A recording by the name of its file, or open already."""


@contextmanager
def opened(recording: RecordingFile) -> Iterator["Recording"]:
    """Open a recording file for a block; a recording that is open already is used as it is, and stays open.

    Parameters
    ----------
    recording
        Name of a file, or an open recording.
    """
    if isinstance(recording, Recording):
        yield recording
    else:
        with Recording(path_of(recording)) as found:
            yield found


@contextmanager
def all_opened(recordings: Iterable[RecordingFile]) -> Iterator[list["Recording"]]:
    """Open several recordings for a block, see :func:`opened`.

    Parameters
    ----------
    recordings
        Names of files, or open recordings.
    """
    with ExitStack() as stack:
        yield [stack.enter_context(opened(recording)) for recording in recordings]


def path_of(recording: "RecordingFile | Stream") -> Path:
    """Path of the file of a recording.

    Raises
    ------
    InputError
        Something that is neither a name nor a recording.
    """
    if isinstance(recording, Recording | Stream):
        return recording.path
    if isinstance(recording, str | os.PathLike):
        return Path(recording)
    raise InputError(f"a {type(recording).__name__} is no recording; give a recording or the name of its file")
