"""`Source`: anything that samples come from, block by block; events and the feeds that give them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError

from ..channels import Channel


@dataclass(frozen=True)
class EventAxis:
    """Clock in which the times of a series are told.

    Parameters
    ----------
    kind
        ``samples``: the recording's own time axis; ``host``: the host's monotonic time;
        ``device``: a clock of the device's own, and the host's arrival times are stored beside.
    clock
        Name of the device's clock; series of one clock are aligned together.
    texts
        Whether a short text comes with each value, such as a mark's note.

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


TEXT_BYTES = 240
"""Room for the text of a value; a longer one is cut."""

SAMPLES_AXIS = EventAxis()
"""Times on the axis of the samples, s."""

HOST_AXIS = EventAxis("host")
"""Times of the host's monotonic clock, s."""


@dataclass(frozen=True)
class Events:
    """Values of one series, as a source hands them over.

    Parameters
    ----------
    series
        Name of the series.
    times : (n,), s
        Times in the clock that the series' axis names.
    values : (n,)
        Values at these times.
    arrivals : (n,), s, or None
        Host's monotonic time at which each value was there; needed where the axis is a device's.
    texts : n of them, or None
        Text of each value, needed where the axis has texts; longer ones are cut to `TEXT_BYTES` bytes of UTF-8.
    """

    series: str
    times: NDArray[np.float64]
    values: NDArray[np.float64]
    arrivals: NDArray[np.float64] | None = None
    texts: tuple[str, ...] | None = None


@runtime_checkable
class AnnouncesEvents(Protocol):
    """A source that also gives `Events`."""

    @property
    def event_series(self) -> Mapping[str, EventAxis]:
        """The series to come and the clock of each."""


def stored_texts(texts: Sequence[str]) -> NDArray[np.bytes_]:
    """Texts as they are stored: UTF-8, cut at a whole character to `TEXT_BYTES`.

    Examples
    --------
    >>> stored_texts(["Fräser " + 120 * "ü"])[0].decode()[-3:]
    'üüü'
    """
    cut = [" ".join(text.split()).encode("utf-8", "replace")[:TEXT_BYTES].decode("utf-8", "ignore") for text in texts]
    return np.array([text.encode() for text in cut], f"S{TEXT_BYTES}")


def announced_events(source: object) -> dict[str, EventAxis]:
    """The series a source announces; none where it does not give events."""
    return dict(source.event_series) if isinstance(source, AnnouncesEvents) else {}


@dataclass(frozen=True)
class StreamDescription:
    """One sample clock: its name, rate and channels.

    Parameters
    ----------
    name
        Name of the clock, the group's name in a recording.
    sample_rate : Hz
        Samples a second, positive.
    start_time : s
        Time of the first sample on the recording's time axis.
    channels
        Channels along the columns; their names are unique.

    Raises
    ------
    InputError
        A rate that is not positive, no channel, or two of one name.
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
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"stream {self.name}: channel {', '.join(twice)} appears twice; give unique names")

    @property
    def common_delay(self) -> float:
        """Delay of the least delayed channel's samples, s; events are put on that channel's axis."""
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
        Host's monotonic time when the last sample was there; NaN where there is none.
    host_sample
        Number of samples that were there at ``host_time``, where the device can tell; None: up to the block's last.
    """

    stream: str
    first_sample: int
    samples: NDArray[np.float64]
    host_time: float = float("nan")
    host_sample: int | None = None


@runtime_checkable
class Source(Protocol):
    """Interface of a driver: opened, read until None, closed. Drivers need not share a base class."""

    @property
    def title(self) -> str:
        """Title for the recording."""

    @property
    def setup(self) -> str:
        """Tool, cut and pose as TOML text."""

    @property
    def streams(self) -> tuple[StreamDescription, ...]:
        """The sample clocks it delivers."""

    @property
    def n_samples(self) -> int | None:
        """Samples to come over all streams, where that is known."""

    def open(self) -> None:
        """Start; may be called again after ``close`` to start anew."""

    def read(self) -> Block | Events | None:
        """The next block or events, or None when there is no more; a source of events also has `event_series`."""

    def close(self) -> None:
        """Stop and release the device; harmless when not open."""


@runtime_checkable
class Finishes(Protocol):
    """A source that has more to tell when its samples are over: events of the last block, last words of devices."""

    def finish(self) -> None:
        """Ask for the end: the next reads give no new sample, but what is still to be told, then None."""


class AroundSource:
    """Title, set-up, streams and number of samples of the source within.

    Parameters
    ----------
    source
        The one that is wrapped.
    """

    def __init__(self, source: Source) -> None:
        self._source = source

    @property
    def title(self) -> str:
        """The source's title."""
        return self._source.title

    @property
    def setup(self) -> str:
        """The source's setup."""
        return self._source.setup

    @property
    def streams(self) -> tuple[StreamDescription, ...]:
        """The source's streams."""
        return self._source.streams

    @property
    def n_samples(self) -> int | None:
        """The source's number of samples."""
        return self._source.n_samples

    @property
    def notices(self) -> tuple[str, ...]:
        """What the source says of its settings before it runs, one sentence each."""
        return tuple(getattr(self._source, "notices", ()))


@runtime_checkable
class EventFeed(Protocol):
    """A device that gives events, or none but is switched on and off with the recording (an amplifier)."""

    @property
    def event_series(self) -> Mapping[str, EventAxis]:
        """The series it gives and the clock of each."""

    def open(self) -> None:
        """Start to receive events."""

    def poll(self) -> list[Events]:
        """Give the events since the last call, without waiting; raise an error of the receiver."""

    def close(self) -> None:
        """Stop and release the device; harmless when not open."""


@runtime_checkable
class TellsNotes(Protocol):
    """A feed that also knows its device's name, how to open it again, and what the recording shall tell of it."""

    where: str

    def reopen(self) -> None:
        """Open a device that was lost, while the recording goes on."""

    def drop(self) -> None:
        """Let go of a device that was lost, without a word to it."""

    def notes(self) -> list[tuple[float, str]]:
        """Give what was noted since the last call: host's time (s) and text."""

    def conclude(self) -> None:
        """Note what is worth telling at the end of a recording."""
