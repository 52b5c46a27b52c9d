"""Times of events, told by the host's or a device's clock, on the time axis of the samples."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError, InputError

from ..clock import ClockFit, fit_clock
from ..sources.source import StreamDescription
from .event_series import EventSeries


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
