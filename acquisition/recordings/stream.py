"""`Stream`: samples of one clock in an open recording, read in blocks."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from foundation import InputError, Summary, counted, drawing, listed, optional_library

from ..channel import Channel
from ..file_safety import reporting_damage
from ..sources import StreamDescription
from .checked_samples import CheckedSamples, DamagedRows

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.axes import Axes


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
        """Draw the envelope of each channel and return the axes; see :func:`figures.draw_stream`."""
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
