"""`Recording`: a recording file opened for reading; samples are read in blocks, never as a whole."""

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import TracebackType

import h5py
import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError, InputError

from ..channel import Channel
from ..file_safety import is_being_written, open_for_reading, reporting_damage, require_stored, whole_rows
from ..sources import StreamDescription
from .alignment import Alignment
from .event_series import EventSeries
from .recording_format import check_format, stream_from_attributes, text_attribute


class Stream:
    """Samples of one clock in an open recording.

    Parameters
    ----------
    description
        Name, rate and channels.
    samples
        The dataset ``(n_samples, n_channels)``; rows are read when asked for.
    path
        Path of the file, for messages.
    """

    def __init__(self, description: StreamDescription, samples: h5py.Dataset, path: Path) -> None:
        self.description = description
        self.path = path
        self._samples = samples

    @property
    def name(self) -> str:
        """Name of the clock."""
        return self.description.name

    @property
    def sample_rate(self) -> float:
        """Hz."""
        return self.description.sample_rate

    @property
    def start_time(self) -> float:
        """Time of the first sample, s."""
        return self.description.start_time

    @property
    def channels(self) -> tuple[Channel, ...]:
        """One a column."""
        return self.description.channels

    @property
    def n_samples(self) -> int:
        """Rows stored."""
        return int(self._samples.shape[0])

    @property
    def dtype(self) -> "np.dtype[np.floating]":
        """How samples are stored: float32 or float64."""
        stored: np.dtype[np.floating] = self._samples.dtype
        return stored

    @property
    def duration(self) -> float:
        """n_samples / sample_rate, s."""
        return self.n_samples / self.sample_rate

    def whole_rows(self, file_size: int) -> int:
        """Leading rows whose bytes lie within a file of ``file_size`` bytes; fewer than n_samples in a cut file."""
        with reporting_damage(self.path):
            return whole_rows(self._samples, file_size)

    def channels_of(self, quantity: str) -> tuple[Channel, ...]:
        """The channels of one quantity, in column order."""
        return tuple(channel for channel in self.channels if channel.quantity == quantity)

    def columns(self, names: Sequence[str]) -> list[int]:
        """Column numbers of named channels.

        Raises
        ------
        InputError
            A name that is not there; the message lists those that are.
        """
        there = [channel.name for channel in self.channels]
        missing = [name for name in names if name not in there]
        if missing:
            raise InputError(
                f"{self.path.name}: no channel {', '.join(missing)} in stream {self.name}; it has {', '.join(there)}"
            )
        return [there.index(name) for name in names]

    def read(
        self, start: int = 0, stop: int | None = None, channels: Sequence[str] | None = None
    ) -> NDArray[np.float64]:
        """Rows ``start`` to ``stop`` as float64, shape (n_samples, n_channels), SI units.

        Raises
        ------
        InputError
            An unknown channel.
        FileFormatError
            The file's bytes cannot be read there.
        """
        try:
            rows = np.asarray(self._samples[start:stop], dtype=float)
        except OSError as error:
            raise FileFormatError(
                f"{self.path}: samples {start} to {stop} of {self.name} cannot be read; the file is damaged"
            ) from error
        return rows if channels is None else rows[:, self.columns(channels)]

    def blocks(
        self, block_length: int = 1 << 16, channels: Sequence[str] | None = None
    ) -> Iterator[NDArray[np.float64]]:
        """All rows in order, at most ``block_length`` at a time."""
        if channels is not None:
            self.columns(channels)
        for start in range(0, self.n_samples, block_length):
            yield self.read(start, min(start + block_length, self.n_samples), channels)


class Recording:
    """A recording opened for reading; use it in a ``with`` block.

    Parameters
    ----------
    path
        An HDF5 file of format ``millfrf.recording``, version 1.
    accept_cut
        Open a file that ends before its samples do; their missing part must then not be read. For recovery.

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
            samples = clock.get("samples") if isinstance(clock, h5py.Group) else None
            if not isinstance(samples, h5py.Dataset) or samples.ndim != 2 or samples.dtype.kind != "f":
                raise FileFormatError(f"{self.path}: /signals/{name} has no table 'samples' of floats; convert anew")
            if not self._accept_cut:
                require_stored(samples, name, self.path)
            described = stream_from_attributes(name, clock.attrs, samples.shape[1], self.path)
            streams[name] = Stream(described, samples, self.path)
        return streams

    @property
    def title(self) -> str:
        """Title, possibly empty."""
        return self._text("title")

    @property
    def recorded_at(self) -> str:
        """ISO 8601 UTC."""
        return self._text("recorded_at")

    @property
    def setup(self) -> str:
        """Tool, cut and pose as TOML text."""
        return self._text("setup")

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
            plain = {} if group is None else {name: EventSeries(entry) for name, entry in group.items()}
            alignment = Alignment(described, self.clock_pairs(stream), plain)
            return {name: EventSeries(group[name], partial(alignment.read, name)) for name in plain}

    def clock_pairs(self, stream: str) -> NDArray[np.float64]:
        """Pairs (sample index, host monotonic time in s) of a stream, shape (n_pairs, 2)."""
        with reporting_damage(self.path):
            pairs = self._file["signals"][stream].get("clock")
            return np.empty((0, 2)) if pairs is None else np.asarray(pairs[:], dtype=float).reshape(-1, 2)

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
