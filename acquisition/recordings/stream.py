"""`Stream`: samples of one clock in an open recording, read in blocks and verified by their checksums."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, Real, Summary, command, counted, drawing, listed, optional_library

from ..channels import Channel
from ..sources.source import StreamDescription
from .guarded_reading import reporting_damage, rows_within
from .recording_format import BlockTable, samples_sum

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes

    from .arrays import TemporaryFolder
    from .carving import RawSamples

Rows = NDArray[np.floating]


@dataclass(frozen=True)
class DamagedRows:
    """Damaged rows of a stream, from ``first`` to before ``end``, with the reason in a few words."""

    first: int
    end: int
    reason: str


def stated_missing(columns: Sequence[NDArray[np.generic]]) -> tuple[DamagedRows, ...]:
    """Return missing rows and their stated reasons from the columns of a table of missing rows."""
    return tuple(
        DamagedRows(int(first), int(first) + int(rows), bytes(reason).decode("utf-8", "replace"))
        for first, rows, reason in zip(*columns, strict=True)
    )


class DamagedSamplesError(FileFormatError):
    """Samples are damaged; ``rows`` says which samples, and why."""

    def __init__(self, message: str, rows: DamagedRows) -> None:
        super().__init__(message)
        self.rows = rows


class CheckedSamples:
    """Samples (n_samples, n_channels) of one stream that are verified with the checksums of its blocks.

    ``table`` lists the blocks; it is None in a file of version 1. ``name`` and ``path`` of the stream are for messages.
    """

    def __init__(self, dataset: "h5py.Dataset | RawSamples", table: BlockTable | None, name: str, path: Path) -> None:
        self.dataset, self.table = dataset, table
        self._name, self._path = name, path
        self._verified = np.zeros(0 if table is None else len(table.entries), dtype=bool)

    @property
    def n_rows(self) -> int:
        """Return the number of acknowledged rows: those up to the end of the last valid block."""
        stored = int(self.dataset.shape[0])
        return stored if self.table is None else min(stored, self.table.n_rows)

    @property
    def has_checksums(self) -> bool:
        return self.table is not None

    def check_end(self) -> None:
        """Refuse a table whose last blocks are damaged, or that holds fewer rows than its blocks announce."""
        lost = self._lost_at_end()
        if lost is not None:
            raise self._damage(lost)

    def read(self, start: int, stop: int) -> Rows:
        """Read rows as they are stored; each block is verified when it is first read."""
        if self.table is None or start >= stop:
            return self._stored(start, stop)
        for first, end in self.table.uncovered:
            if first < stop and end > start:
                raise self._damage(DamagedRows(first, end, "their checksum is damaged"))
        numbers = self.table.covering(start, stop)
        if self._verified[numbers.start : numbers.stop].all():
            return self._stored(start, stop)
        entries = self.table.entries[numbers.start : numbers.stop]
        first = int(entries[0]["first_row"])
        rows = self._stored(first, int(entries[-1]["first_row"]) + int(entries[-1]["rows"]))
        for number, entry in zip(numbers, entries, strict=True):
            if self.table.valid[number] and not self._verified[number]:
                self._verify(rows, first, entry)
                self._verified[number] = True
        return rows[start - first : stop - first]

    def _verify(self, rows: Rows, first: int, entry: np.void) -> None:
        """Refuse a block that does not match its checksum; ``rows`` begins with row ``first`` of the stream."""
        begin = int(entry["first_row"])
        end = begin + int(entry["rows"])
        if samples_sum(rows[begin - first : end - first], begin) != entry["samples_sum"]:
            raise self._damage(DamagedRows(begin, end, "they do not match their checksum"))

    def recovered_parts(self, file_size: int) -> Iterator[Rows | DamagedRows]:
        """Yield all rows in order, part by part; for damaged rows, yield their numbers and the reason.

        ``file_size`` is the number of bytes in the file: a file that was cut ends before its rows do.
        """
        # A checksum shows whether a block is there. Without checksums only the file's size does.
        available = self.n_rows if self.table is not None else rows_within(self.dataset, file_size)
        for first, end in self._parts():
            if end > available:
                yield DamagedRows(first, end, "the file ends before them")
                continue
            try:
                yield self.read(first, end)
            except DamagedSamplesError as error:
                yield error.rows
        lost = self._lost_at_end()
        if lost is not None:
            yield lost

    def _parts(self) -> list[tuple[int, int]]:
        """Return the blocks and the rows between them; chunks if there are no blocks; else 16384 rows at a time."""
        n_rows = self.n_rows
        if self.table is None:
            step = (self.dataset.chunks or (1 << 14,))[0]
            return [(start, min(start + step, n_rows)) for start in range(0, n_rows, step)]
        spans = sorted([*self.table.spans, *self.table.uncovered])
        return [(first, min(end, n_rows)) for first, end in spans if first < n_rows]

    def _lost_at_end(self) -> DamagedRows | None:
        """Return the rows at the end that the blocks announce and that are missing, or that have no valid entry."""
        if self.table is None:
            return None
        stored, announced = int(self.dataset.shape[0]), self.table.n_rows
        if announced > stored:
            return DamagedRows(stored, announced, "the file does not hold them")
        if self.table.damaged_at_end:
            return DamagedRows(announced, max(stored, announced + 1), "their checksum is damaged")
        return None

    def _stored(self, start: int, stop: int) -> Rows:
        try:
            return np.asarray(self.dataset[start:stop])
        except (OSError, RuntimeError, ValueError) as error:
            if not self.dataset:
                raise InputError(f"{self._path}: the recording was closed; open it again") from error
            raise self._damage(DamagedRows(start, stop, "they cannot be read")) from error

    def _damage(self, rows: DamagedRows) -> DamagedSamplesError:
        return DamagedSamplesError(
            f"{self._path}: samples {rows.first} to {rows.end - 1} of {self._name} are damaged ({rows.reason}); "
            f"save the sound ones: {command('recover', self._path)}",
            rows,
        )


class Stream:
    """Samples of one clock in an open recording; they are read on request.

    Parameters
    ----------
    description
        Name, sample rate and channels.
    samples
        Dataset (n_samples, n_channels) with its checksums.
    path
        Path of the recording.
    """

    def __init__(self, description: StreamDescription, samples: CheckedSamples, path: Path) -> None:
        self.description = description
        self.path = path
        self.samples = samples
        self.folder: TemporaryFolder | None = None  # of a recording of arrays

    @property
    def name(self) -> str:
        """Return the name of the clock."""
        return self.description.name

    @property
    def sample_rate(self) -> float:
        """Return the samples per second, Hz."""
        return self.description.sample_rate

    @property
    def start_time(self) -> float:
        """Return the time of the first sample, s."""
        return self.description.start_time

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Return the channels in the order of the columns."""
        return self.description.channels

    @property
    def n_samples(self) -> int:
        """Return the number of stored samples."""
        return self.samples.n_rows

    @property
    def dtype(self) -> "np.dtype[np.floating]":
        """Return the type of the stored samples: float32 or float64."""
        stored: np.dtype[np.floating] = self.samples.dataset.dtype
        return stored

    @property
    def duration(self) -> float:
        """Return the duration ``n_samples / sample_rate``, s."""
        return self.n_samples / self.sample_rate

    @property
    def has_checksums(self) -> bool:
        """Return whether samples have checksums, so that damaged samples are refused."""
        return self.samples.has_checksums

    def recovered_parts(self, file_size: int) -> Iterator[Rows | DamagedRows]:
        """Yield all rows in order, part by part; see `CheckedSamples.recovered_parts`."""
        with reporting_damage(self.path):
            yield from self.samples.recovered_parts(file_size)

    def channels_of(self, quantity: str) -> tuple[Channel, ...]:
        """Select the channels of one quantity, in the order of the columns."""
        return tuple(channel for channel in self.channels if channel.quantity == quantity)

    def columns(self, names: Sequence[str]) -> list[int]:
        """Return the column numbers of named channels.

        Raises
        ------
        InputError
            An unknown name; the message lists the known names.
        """
        known = [channel.name for channel in self.channels]
        missing = [name for name in names if name not in known]
        if missing:
            raise InputError(
                f"{self.path.name}: no channel {', '.join(missing)} in stream {self.name}; it has {', '.join(known)}"
            )
        return [known.index(name) for name in names]

    def read(self, start: int = 0, stop: int | None = None, channels: Sequence[str] | None = None) -> Real:
        """Read rows ``start`` to before ``stop`` as float64, (n_samples, n_channels), in SI units.

        Raises
        ------
        InputError
            An unknown channel.
        FileFormatError
            Samples there are damaged.
        """
        first, end, _ = slice(start, stop).indices(self.n_samples)
        rows = np.asarray(self.samples.read(first, end), dtype=float)
        return rows if channels is None else rows[:, self.columns(channels)]

    def blocks(self, block_length: int = 1 << 16, channels: Sequence[str] | None = None) -> Iterator[Real]:
        """Yield all rows in order, at most ``block_length`` at a time."""
        if channels is not None:
            self.columns(channels)
        for start in range(0, self.n_samples, block_length):
            yield self.read(start, min(start + block_length, self.n_samples), channels)

    @property
    def times(self) -> Real:
        """Return the time of each sample, s, (n_samples,)."""
        return self.start_time + np.arange(self.n_samples) / self.sample_rate

    def plot(self, axes: "Axes | None" = None, *, channels: Sequence[str] | None = None) -> "Axes":
        """Draw the envelope of each channel and return the axes; see `draw_stream`."""
        return drawing("draw_stream")(self, axes, channels=channels)

    def to_xarray(self) -> "xarray.DataArray":
        """Read all samples into an array with the axes ``time`` (s) and ``channel``; it takes 8 bytes per sample.

        Raises
        ------
        InputError
            xarray is not installed.
        """
        xr = optional_library("xarray", "Stream.to_xarray")
        names, units = ([getattr(channel, field) for channel in self.channels] for field in ("name", "unit"))
        coordinates = {"time": self.times, "channel": names, "unit": ("channel", units)}
        return xr.DataArray(self.read(), coordinates, ("time", "channel"), name=self.name)

    def to_frame(self) -> "pandas.DataFrame":
        """Read all samples into a table: a row per time (s), a column per channel; it takes 8 bytes per sample.

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
        """Summarize the clock and its channels in a few lines."""
        size = f"{counted(len(self.channels), 'channel')}, {self.duration:.4g} s at {self.sample_rate:g} Hz"
        return Summary(
            f"Stream {self.name}: {size}",
            (f"channels {listed([channel.name for channel in self.channels])}",),
            ("channel", "quantity", "unit", "degree of freedom"),
            tuple((c.name, c.quantity, c.unit, c.degree_of_freedom) for c in self.channels),
        )
