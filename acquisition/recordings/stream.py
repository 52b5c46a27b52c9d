"""`Stream`: samples of one clock in an open recording, read in blocks and verified by their checksums."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, Summary, counted, drawing, listed, optional_library

from ..channels import Channel
from ..sources.source import StreamDescription
from .guarded_reading import reporting_damage, whole_rows
from .recording_format import ENTRY, BlockTable, samples_sum

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


Rows = NDArray[np.floating]

BESIDE = 1 << 14
"""Rows that are salvaged at a time where the file has neither blocks nor chunks."""


@dataclass(frozen=True)
class DamagedRows:
    """Rows of a stream that are not what was recorded.

    Parameters
    ----------
    first, end
        Number of the first row, and the number behind the last.
    reason
        What is wrong with them, in a few words.
    """

    first: int
    end: int
    reason: str


class DamagedSamplesError(FileFormatError):
    """Samples that are not what was recorded.

    Parameters
    ----------
    message
        One line with the file and the rows.
    found
        The rows and the reason.
    """

    def __init__(self, message: str, found: DamagedRows) -> None:
        super().__init__(message)
        self.found = found


class CheckedSamples:
    """The table of samples of one stream, with the checksums of its blocks where the file has them.

    Parameters
    ----------
    samples
        The dataset ``(n_samples, n_channels)``.
    table
        The blocks' entries; None: a file of version 1, which cannot tell.
    name
        Name of the stream, for messages.
    path
        Path of the file, for messages.
    """

    def __init__(self, samples: h5py.Dataset, table: BlockTable | None, name: str, path: Path) -> None:
        self.dataset = samples
        self._name, self._path, self._table = name, path, table
        self._passed = np.zeros(0 if table is None else len(table.entries), dtype=bool)

    @property
    def n_rows(self) -> int:
        """Rows that were acknowledged: all up to the end of the last sound block."""
        stored = int(self.dataset.shape[0])
        return stored if self._table is None else min(stored, self._table.n_rows)

    @property
    def has_checksums(self) -> bool:
        """Whether damaged rows would be noticed."""
        return self._table is not None

    def require_whole_end(self) -> None:
        """Refuse a table whose last blocks are damaged, or that holds fewer rows than its blocks announce.

        Raises
        ------
        DamagedSamplesError
            What is lost.
        """
        lost = self._lost_at_end()
        if lost is not None:
            raise self._damage(lost)

    def read(self, start: int, stop: int) -> Rows:
        """Rows as they are stored.

        Raises
        ------
        DamagedSamplesError
            A block in which some of them lie cannot be read, or does not match its checksum.
        """
        if self._table is None or start >= stop:
            return self._stored(start, stop)
        for first, end in self._table.uncovered:
            if first < stop and end > start:
                raise self._damage(DamagedRows(first, end, "their checksum is damaged"))
        numbers = self._table.covering(start, stop)
        if self._passed[numbers.start : numbers.stop].all():
            return self._stored(start, stop)
        entries = self._table.entries[numbers.start : numbers.stop]
        first = int(entries[0]["first_row"])
        rows = self._stored(first, int(entries[-1]["first_row"]) + int(entries[-1]["rows"]))
        for number, entry in zip(numbers, entries, strict=True):
            if self._table.sound[number] and not self._passed[number]:
                self._check(rows, first, entry)
                self._passed[number] = True
        return rows[start - first : stop - first]

    def _check(self, rows: Rows, first: int, entry: np.void) -> None:
        """Refuse a block, among rows from ``first`` on, that does not match its checksum."""
        begin = int(entry["first_row"])
        end = begin + int(entry["rows"])
        if samples_sum(rows[begin - first : end - first], begin) != entry["samples_sum"]:
            raise self._damage(DamagedRows(begin, end, "they do not match their checksum"))

    def salvaged(self, file_size: int) -> Iterator[Rows | DamagedRows]:
        """All rows in order, part by part; what is damaged is named instead of given back.

        Parameters
        ----------
        file_size
            Bytes that the file holds: a file that was cut ends before its rows do.
        """
        # a block shows by its checksum whether it is there; without checksums the file's size must do
        held = self.n_rows if self._table is not None else whole_rows(self.dataset, file_size)
        for first, end in self._parts():
            if end > held:
                yield DamagedRows(first, end, "the file ends before them")
                continue
            try:
                yield self.read(first, end)
            except DamagedSamplesError as error:
                yield error.found
        lost = self._lost_at_end()
        if lost is not None:
            yield lost

    def _parts(self) -> list[tuple[int, int]]:
        """Parts in which rows are salvaged: blocks and what lies between them, or chunks where there are no blocks."""
        if self._table is None:
            step, n_rows = (self.dataset.chunks or (BESIDE,))[0], self.n_rows
            return [(at, min(at + step, n_rows)) for at in range(0, n_rows, step)]
        held = self.n_rows
        return [(a, min(b, held)) for a, b in sorted([*self._table.spans, *self._table.uncovered]) if a < held]

    def _lost_at_end(self) -> DamagedRows | None:
        """Rows at the end that the blocks announce and that are not there, or that no sound block tells of."""
        if self._table is None:
            return None
        stored, told = int(self.dataset.shape[0]), self._table.n_rows
        if told > stored:
            return DamagedRows(stored, told, "the file does not hold them")
        if self._table.damaged_at_end:
            return DamagedRows(told, max(stored, told + 1), "their checksum is damaged")
        return None

    def _stored(self, start: int, stop: int) -> Rows:
        try:
            return np.asarray(self.dataset[start:stop])
        except (OSError, RuntimeError) as error:
            raise self._damage(DamagedRows(start, stop, "they cannot be read")) from error

    def _damage(self, found: DamagedRows) -> DamagedSamplesError:
        return DamagedSamplesError(
            f"{self._path}: samples {found.first} to {found.end - 1} of {self._name} are damaged ({found.reason}); "
            "save the sound ones with millfrf recover",
            found,
        )


def block_table(blocks: object, name: str, path: Path) -> BlockTable:
    """The entries of a stream's blocks as a file has them.

    Parameters
    ----------
    blocks
        The dataset ``/signals/<name>/blocks``.
    name
        Name of the stream, for messages.
    path
        Path of the file, for messages.

    Raises
    ------
    FileFormatError
        It is no such table.
    """
    if not isinstance(blocks, h5py.Dataset) or blocks.ndim != 1 or blocks.dtype != ENTRY:
        raise FileFormatError(f"{path}: /signals/{name} has no table 'blocks' of checksums; convert anew")
    return BlockTable.read(np.asarray(blocks[:]))


class Stream:
    """Samples of one clock in an open recording.

    Parameters
    ----------
    description
        Name, rate and channels.
    samples
        The dataset ``(n_samples, n_channels)`` with its checksums; rows are read when asked for.
    path
        Path of the file, for messages.
    """

    def __init__(self, description: StreamDescription, samples: CheckedSamples, path: Path) -> None:
        self.description = description
        self.path = path
        self._samples = samples

    @property
    def name(self) -> str:
        """Name of the clock."""
        return self.description.name

    @property
    def sample_rate(self) -> float:
        """Samples a second, Hz."""
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
        """Number of samples that are stored."""
        return self._samples.n_rows

    @property
    def dtype(self) -> "np.dtype[np.floating]":
        """How samples are stored: float32 or float64."""
        stored: np.dtype[np.floating] = self._samples.dataset.dtype
        return stored

    @property
    def duration(self) -> float:
        """n_samples / sample_rate, s."""
        return self.n_samples / self.sample_rate

    @property
    def has_checksums(self) -> bool:
        """Whether samples were stored with checksums, so that damaged ones are refused."""
        return self._samples.has_checksums

    def salvaged(self, file_size: int) -> Iterator[NDArray[np.floating] | DamagedRows]:
        """All rows in order, part by part; damaged ones are named instead (``CheckedSamples.salvaged``)."""
        with reporting_damage(self.path):
            yield from self._samples.salvaged(file_size)

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
            Samples there are damaged.
        """
        first, end, _ = slice(start, stop).indices(self.n_samples)
        rows = np.asarray(self._samples.read(first, end), dtype=float)
        return rows if channels is None else rows[:, self.columns(channels)]

    def blocks(
        self, block_length: int = 1 << 16, channels: Sequence[str] | None = None
    ) -> Iterator[NDArray[np.float64]]:
        """All rows in order, at most ``block_length`` at a time."""
        if channels is not None:
            self.columns(channels)
        for start in range(0, self.n_samples, block_length):
            yield self.read(start, min(start + block_length, self.n_samples), channels)

    @property
    def times(self) -> NDArray[np.float64]:
        """Time of each sample, s, shape (n_samples,)."""
        return self.start_time + np.arange(self.n_samples) / self.sample_rate

    def plot(self, axes: "Axes | None" = None, *, channels: Sequence[str] | None = None) -> "Axes":
        """Draw the envelope of each channel and return the axes; see `draw_stream`."""
        return drawing("draw_stream")(self, axes, channels=channels)

    def to_xarray(self) -> "xarray.DataArray":
        """All samples as one array with the axes ``time`` (s) and ``channel``; it takes 8 bytes a sample.

        Raises
        ------
        InputError
            xarray is not installed.
        """
        xr = optional_library("xarray", "Stream.to_xarray")
        names, units = ([getattr(channel, what) for channel in self.channels] for what in ("name", "unit"))
        places = {"time": self.times, "channel": names, "unit": ("channel", units)}
        return xr.DataArray(self.read(), places, ("time", "channel"), name=self.name)

    def to_frame(self) -> "pandas.DataFrame":
        """All samples as a table: one row a time (s), one column a channel; it takes 8 bytes a sample.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        pd = optional_library("pandas", "Stream.to_frame")
        names = [channel.name for channel in self.channels]
        return pd.DataFrame(self.read(), index=pd.Index(self.times, name="time_s"), columns=names)

    def __repr__(self) -> str:
        return self.summary().text()

    def _repr_html_(self) -> str:
        return self.summary().html()

    def summary(self) -> Summary:
        """Name the clock and its channels in a few lines."""
        rows = tuple((one.name, one.quantity, one.unit, one.degree_of_freedom) for one in self.channels)
        size = f"{counted(len(self.channels), 'channel')}, {self.duration:.4g} s at {self.sample_rate:g} Hz"
        return Summary(
            f"Stream {self.name}: {size}",
            (f"channels {listed([one.name for one in self.channels])}",),
            ("channel", "quantity", "unit", "degree of freedom"),
            rows,
        )
