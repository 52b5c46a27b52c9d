"""`Source`: anything samples come from, block by block: a device, a file, the simulated cell."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..channel import Channel
from .events import Events


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
