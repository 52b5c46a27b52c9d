"""Slow or asynchronous values: in which clock their times are told, and how a source hands them over."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from foundation import InputError


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
