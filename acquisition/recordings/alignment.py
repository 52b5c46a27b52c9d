"""Alignment in time: late channels brought to common times, events on the time axis of the samples."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, Real

from ..clocks import ClockFit, fit_clock
from ..sources.source import StreamDescription
from .stream import Stream
from .tables import EventSeries

_HALF = 31
_BETA = 8.0
_WHOLE = 1e-6
"""Rows; a delay this near to a whole number of rows needs no interpolation."""


class Aligner:
    """Takes samples block by block and gives them with all channels at the same times.

    Parameters
    ----------
    delays : (n_channels,), s
        Time by which each channel's samples come late; only their differences matter, none may be below zero.
    sample_rate : Hz
        Samples a second.

    Examples
    --------
    >>> rows = np.arange(200.0)
    >>> late = np.sin(0.5 * (rows[:, None] - [0.0, 2.25]))
    >>> even = Aligner([0.0, 2.25e-3], 1000.0).add(late)
    >>> bool(np.abs(even[:, 1] - even[:, 0]).max() < 2e-4)
    True
    """

    def __init__(self, delays: Sequence[float], sample_rate: float) -> None:
        rows = np.asarray(delays, dtype=float) * sample_rate
        self._shifts = np.round(rows).astype(int)
        fractions = rows - self._shifts
        self._kernels = [_kernel(f) if abs(f) > _WHOLE else None for f in fractions]
        self.skipped = _HALF if any(kernel is not None for kernel in self._kernels) else 0
        self._held: Real | None = None

    @property
    def idle(self) -> bool:
        """Whether there is nothing to do: no channel is later than another."""
        return self.skipped == 0 and not self._shifts.any()

    def add(self, samples: Real) -> Real:
        """Take the next rows (n, n_channels); return those that are complete by now, the first of them ``skipped``
        rows after the first that came.
        """
        if self.idle:
            return samples
        held = samples if self._held is None else np.concatenate([self._held, samples])
        n_out = len(held) - 2 * self.skipped - int(self._shifts.max())
        if n_out <= 0:
            self._held = held
            return np.empty((0, held.shape[1]))
        even = np.empty((n_out, held.shape[1]))
        for column, (shift, kernel) in enumerate(zip(self._shifts, self._kernels, strict=True)):
            part = held[shift : shift + n_out + 2 * self.skipped, column]
            even[:, column] = (
                part[self.skipped : self.skipped + n_out] if kernel is None else np.correlate(part, kernel, "valid")
            )
        self._held = held[n_out:].copy()
        return even


def relative_delays(stream: StreamDescription, names: Sequence[str]) -> list[float]:
    """Delay of each named channel behind the stream's least delayed one, s."""
    known = {channel.name: channel.input_delay_s or 0.0 for channel in stream.channels}
    return [known[name] - stream.common_delay for name in names]


def rows_left_out(stream: Stream, names: Sequence[str]) -> int:
    """Rows at the beginning that :func:`aligned_blocks` leaves out; 0 where no delay of named channels differs."""
    return Aligner(relative_delays(stream.description, names), stream.sample_rate).skipped


def aligned_blocks(stream: Stream, names: Sequence[str], block_length: int = 1 << 16) -> Iterator[Real]:
    """Rows of named channels with their known input delays taken out, block by block.

    Where delays differ, up to 31 rows at each end and the largest delay are left out: no row leans on data outside the
    record. Where they do not, the rows are those of the file.

    Raises
    ------
    InputError
        A name that is not there.
    """
    stream.columns(names)
    aligner = Aligner(relative_delays(stream.description, names), stream.sample_rate)
    for block in stream.blocks(block_length, names):
        yield aligner.add(block)


def aligned_samples(stream: Stream, names: Sequence[str]) -> Real:
    """All of `aligned_blocks` at once, (n, n_channels)."""
    return np.concatenate([np.empty((0, len(names))), *aligned_blocks(stream, names)])


def _kernel(fraction: float) -> Real:
    """Windowed sinc for a value ``fraction`` of a row after the middle one; its sum is 1."""
    at = np.arange(-_HALF, _HALF + 1) - fraction
    inside = np.clip(1.0 - (at / (_HALF + 1.0)) ** 2, 0.0, None)
    kernel = np.sinc(at) * np.i0(_BETA * np.sqrt(inside)) / np.i0(_BETA)
    return np.asarray(kernel / kernel.sum())


class Alignment:
    """Takes event times to ``start_time + sample / sample_rate`` of one stream.

    Samples that come late by their inputs' delays show an event late: times are those of the least delayed channel.

    Parameters
    ----------
    stream
        Stream on whose samples the times shall lie.
    pairs : (n_pairs, 2)
        The stream's sample counts with the host's monotonic times, s.
    series
        All series of the recording; those of one device clock are fitted together.
    """

    def __init__(
        self, stream: StreamDescription, pairs: NDArray[np.float64], series: Mapping[str, EventSeries]
    ) -> None:
        self._stream = stream
        self._pairs = pairs
        self._series = series

    def stream_clock(self) -> ClockFit:
        """The stream's samples against the host.

        Raises
        ------
        FileFormatError
            The recording holds no pair.
        """
        try:
            return fit_clock(self._pairs[:, 0], self._pairs[:, 1], 1.0 / self._stream.sample_rate)
        except InputError as error:
            raise FileFormatError(f"stream {self._stream.name} cannot be aligned: {error}") from error

    def device_clock(self, clock: str) -> ClockFit:
        """A device's clock against the host, from the arrivals of all its series.

        Raises
        ------
        FileFormatError
            No event of that clock.
        """
        of_clock = [series.read_raw() for series in self._series.values() if series.axis.clock == clock]
        pairs = [(times, arrivals) for times, _, arrivals in of_clock if arrivals is not None]
        try:
            return fit_clock(np.concatenate([p[0] for p in pairs]), np.concatenate([p[1] for p in pairs]), 1.0)
        except (InputError, ValueError) as error:
            raise FileFormatError(f"clock {clock} cannot be aligned: {error}") from error

    def read(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Times on the stream's axis (s) and values of a series, each (n_events,).

        Raises
        ------
        InputError
            No such series.
        FileFormatError
            It cannot be read or aligned.
        """
        if name not in self._series:
            raise InputError(f"no events {name!r}; there are {', '.join(self._series) or 'none'}")
        series = self._series[name]
        times, values, _ = series.read_raw()
        axis = series.axis
        if axis.kind == "samples" or not len(times):
            return times, values
        host = self.device_clock(axis.clock).host(times) if axis.kind == "device" else times
        origin = self._stream.start_time + self._stream.common_delay
        return origin + self.stream_clock().local(host) / self._stream.sample_rate, values
