"""`Source`: interface of a device that gives samples block by block; errors, events and feeds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, MillfrfError, Real

from ..channels import Channel


class DeviceError(MillfrfError):
    """A device failed or answered with an error; base class of the errors below."""


class Overrun(DeviceError):
    """Samples were lost because they were not fetched in time.

    ``n_missing`` is the number of samples missing in each channel; None if the device does not report it.
    """

    def __init__(self, message: str, n_missing: int | None = None) -> None:
        super().__init__(message)
        self.n_missing = n_missing


class Disconnected(DeviceError):
    """The device is gone: unplugged, switched off, or its bus is down."""


class DeviceTimeout(DeviceError):
    """The device sent nothing in time.

    ``since`` is the host's monotonic time of the last message, s; None if it is not known.
    """

    def __init__(self, message: str, since: float | None = None) -> None:
        super().__init__(message)
        self.since = since


class DriverMissing(DeviceError):
    """The Python package or the vendor's library of a device is not installed."""


TEXT_BYTES = 240  # largest size of the text of an event; a longer text is cut


@dataclass(frozen=True)
class EventAxis:
    """Clock of the times of an event series.

    Parameters
    ----------
    kind
        ``samples``: the recording's own time axis; ``host``: the host's monotonic time; ``device``: a clock of the
        device, and the host's arrival times are stored as well.
    clock
        Name of the device's clock; series of one clock are aligned together.
    texts
        Whether each value has a short text, such as the note of a mark.

    Raises
    ------
    InputError
        Another kind, or a device's clock without a name.
    """

    kind: Literal["samples", "host", "device"] = "samples"
    clock: str = ""
    texts: bool = False

    def __post_init__(self) -> None:
        if self.kind not in ("samples", "host", "device"):
            raise InputError(f"time axis {self.kind!r} is not known; use samples, host or device")
        if self.kind == "device" and not self.clock:
            raise InputError("a device's time axis needs the name of its clock, such as can0")


SAMPLES_AXIS = EventAxis()
HOST_AXIS = EventAxis("host")


@dataclass(frozen=True)
class Events:
    """Values of one event series, as a source gives them.

    Parameters
    ----------
    series
        Name of the series.
    times : (n,), s
        Times in the clock of the series' axis.
    values : (n,)
        Values at these times.
    arrivals : (n,), s, or None
        Host's monotonic time at which each value arrived; required if the axis is the clock of a device.
    texts : n of them, or None
        Text of each value, required if the axis has texts; longer ones are cut to 240 bytes of UTF-8.
    """

    series: str
    times: Real
    values: Real
    arrivals: Real | None = None
    texts: tuple[str, ...] | None = None


def stored_texts(texts: Sequence[str]) -> NDArray[np.bytes_]:
    """Encode texts as they are stored: UTF-8, cut at a whole character to `TEXT_BYTES`.

    Examples
    --------
    >>> stored_texts(["Fräser " + 120 * "ü"])[0].decode()[-3:]
    'üüü'
    """
    cut = [" ".join(text.split()).encode("utf-8", "replace")[:TEXT_BYTES].decode("utf-8", "ignore") for text in texts]
    return np.array([text.encode() for text in cut], f"S{TEXT_BYTES}")


def announced_events(source: object) -> dict[str, EventAxis]:
    """Return the event series that a source announces; none for a source without events."""
    return dict(getattr(source, "event_series", {}))


@dataclass(frozen=True)
class StreamDescription:
    """One sample clock: its name, rate and channels.

    Parameters
    ----------
    name
        Name of the clock, and of its group in a recording.
    sample_rate : Hz
        Samples per second, positive.
    start_time : s
        Time of the first sample on the recording's time axis.
    channels
        Channels in the order of the columns; their names are unique.

    Raises
    ------
    InputError
        A rate that is not positive, no channel, or two channels of one name.
    """

    name: str
    sample_rate: float
    start_time: float
    channels: tuple[Channel, ...]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.sample_rate) and self.sample_rate > 0):
            raise InputError(f"stream {self.name}: sample rate {self.sample_rate!r} Hz must be positive")
        if not np.isfinite(self.start_time):
            raise InputError(f"stream {self.name}: start time {self.start_time!r} s must be finite")
        if not self.channels:
            raise InputError(f"stream {self.name} has no channel; name at least one")
        names = [channel.name for channel in self.channels]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise InputError(f"stream {self.name}: channel {', '.join(repeated)} appears twice; give unique names")

    @property
    def common_delay(self) -> float:
        """Return the delay of the least delayed channel, s; events are put on the axis of that channel."""
        return min(channel.input_delay_s or 0.0 for channel in self.channels)


@dataclass(frozen=True)
class Block:
    """Consecutive samples of one stream.

    Parameters
    ----------
    stream
        Name of the sample clock.
    first_sample
        Index of the first row since the start of the recording.
    samples : (n_samples, n_channels)
        Samples in SI units.
    host_time : s
        Host's monotonic time at which the last sample was available; NaN if there is none.
    host_sample
        Number of samples available at ``host_time``, if the device reports it; None: up to the last sample of the
        block.
    """

    stream: str
    first_sample: int
    samples: Real
    host_time: float = float("nan")
    host_sample: int | None = None


@runtime_checkable
class Source(Protocol):
    """Interface of a driver: opened, read until None, closed. Drivers need not share a base class."""

    @property
    def title(self) -> str:
        """Return the title of the recording."""

    @property
    def setup(self) -> str:
        """Return tool, cut and pose as TOML text."""

    @property
    def streams(self) -> tuple[StreamDescription, ...]:
        """Return the sample clocks of the source."""

    @property
    def n_samples(self) -> int | None:
        """Return the number of samples to come over all streams; None if it is not known."""

    def open(self) -> None:
        """Start the source; it can be started again after ``close``."""

    def read(self) -> Block | Events | None:
        """Return the next block or events, or None at the end; a source of events also has `event_series`."""

    def close(self) -> None:
        """Stop and release the device; do nothing if it is not open."""


@runtime_checkable
class Finishes(Protocol):
    """A source, or a feed, that can be ended on request without losing the events of its last block."""

    def finish(self) -> None:
        """Request the end: the next reads return no new samples, but the remaining events, then None."""


class SourceWrapper:
    """Base class of a source around another source: it passes on title, set-up, streams and number of samples.

    Parameters
    ----------
    source
        The wrapped source.
    """

    def __init__(self, source: Source) -> None:
        self._source = source

    @property
    def title(self) -> str:
        """Return the title of the wrapped source."""
        return self._source.title

    @property
    def setup(self) -> str:
        """Return the set-up of the wrapped source."""
        return self._source.setup

    @property
    def streams(self) -> tuple[StreamDescription, ...]:
        """Return the streams of the wrapped source."""
        return self._source.streams

    @property
    def n_samples(self) -> int | None:
        """Return the number of samples of the wrapped source."""
        return self._source.n_samples

    @property
    def notices(self) -> tuple[str, ...]:
        """Return remarks of the wrapped source on its settings, one sentence each."""
        return tuple(getattr(self._source, "notices", ()))


@runtime_checkable
class EventFeed(Protocol):
    """Interface of a device that gives events, or that is only switched with the recording (an amplifier)."""

    @property
    def event_series(self) -> Mapping[str, EventAxis]:
        """Return the event series of the device, and the clock of each."""

    def open(self) -> None:
        """Start to receive events."""

    def poll(self) -> list[Events]:
        """Return the events since the last call without waiting; raise an error of the receiver."""

    def close(self) -> None:
        """Stop and release the device; do nothing if it is not open."""


@runtime_checkable
class NotingFeed(Protocol):
    """A feed that can be reopened during a recording, and that makes notes for the log."""

    where: str  # name of the device

    def reopen(self) -> None:
        """Open a lost device again while the recording goes on."""

    def drop(self) -> None:
        """Release a lost device without sending anything to it."""

    def notes(self) -> list[tuple[float, str]]:
        """Return the notes since the last call: host's monotonic time (s) and text."""

    def conclude(self) -> None:
        """Add the notes on the complete recording, at the end of the recording."""
