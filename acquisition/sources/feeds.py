"""Feeds of events: log of the devices, reconnection of lost devices, and their combination with a source."""

import itertools
import sys
import threading
import time
from collections import deque
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass

import numpy as np

from millfrf.core import InputError, MillfrfError, Real

from ..settings import SETTINGS
from .source import (
    Block,
    DeviceTimeout,
    EventAxis,
    EventFeed,
    Events,
    Finishes,
    NotingFeed,
    Source,
    SourceWrapper,
    announced_events,
)
from .threaded_feed import ThreadedFeed
from .timing import WallClock

DEVICES = "devices"  # event series with the log of the devices
DEVICES_AXIS = EventAxis("host", texts=True)
# Values of that series: a device was lost, is back, or made a remark; an input is at fault (an overload, an open
# loop), or the fault is over.
LOST, BACK, NOTE, FAULT, CLEARED = 0.0, 1.0, 2.0, 3.0, 4.0


def device_event(time_of_event: float, value: float, text: str, series: str = DEVICES) -> Events:
    """Make one entry of the device log at a host's monotonic time, s."""
    return Events(series, np.array([time_of_event]), np.array([value]), None, (text,))


@dataclass(frozen=True)
class DeviceSummary:
    """Summary of the device log of a recording: losses and notices, one sentence each.

    Parameters
    ----------
    losses
        Devices that were lost and inputs that were at fault, with time, reason and duration.
    notices
        Other remarks of the devices: a clock that was set, packets that were lost.
    """

    losses: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()


def device_summary(times: Real, values: Real, texts: Sequence[str]) -> DeviceSummary:
    """Summarize the log of the devices in sentences.

    Parameters
    ----------
    times : (n,), s
        Times of the entries, on any one axis.
    values : (n,)
        Kind of each entry: `LOST`, `BACK`, `NOTE`, `FAULT` or `CLEARED`.
    texts
        Text of each entry, which begins with the device and a colon.

    Examples
    --------
    >>> log = ("CAN bus can0: lost (silent)", "CAN bus can0: back")
    >>> device_summary(np.array([2.0, 5.5]), np.array([LOST, BACK]), log).losses
    ('CAN bus can0: lost (silent) at 2.00 s, back after 3.50 s',)
    """
    unfinished: dict[str, tuple[float, int]] = {}  # by device: time of the loss, and its line
    losses: list[str] = []
    notices: list[str] = []
    for entry_time, value, text in zip(times, values, texts, strict=True):
        device = text.split(": lost")[0].split(": back")[0]
        if value in (LOST, FAULT):
            unfinished[device] = (float(entry_time), len(losses))
            losses.append(f"{text} at {entry_time:.2f} s")
        elif value in (BACK, CLEARED):
            begun, line = unfinished.pop(device, (float(entry_time), -1))
            if line >= 0:
                losses[line] += f", {'back' if value == BACK else 'over'} after {entry_time - begun:.2f} s"
        else:
            notices.append(f"{text} ({entry_time:.2f} s)")
    for _, line in unfinished.values():
        losses[line] += ", until the end" if ": lost" not in losses[line] else ", not back until the end"
    return DeviceSummary(tuple(losses), tuple(notices))


class ReconnectingFeed:
    """A feed around another feed: it passes on the events, and logs losses of the device instead of raising errors.

    A cut cannot be repeated, so no auxiliary device ends it. Opening is strict: a device that is missing before the
    cut is an error. ``log`` is the event series of the log, ``retry`` the time between two attempts to reconnect, s.
    """

    def __init__(self, feed: EventFeed, log: str, retry: float) -> None:
        self._feed, self._log, self._retry = feed, log, retry
        self.where = str(getattr(feed, "where", type(feed).__name__))
        self._stopped = threading.Event()
        self._reconnecting: threading.Thread | None = None
        self._lost_at: float | None = None
        self._is_open = False

    def open(self) -> None:
        """Open the device; raise a DeviceError or InputError if it is missing or wrongly set."""
        self._stopped.clear()
        self._lost_at = None
        self._feed.open()
        self._is_open = True

    def poll(self) -> list[Events]:
        """Return the events since the last call and the entries of the log; never wait and never fail."""
        if not self._is_open:
            return self._log_notes([])
        events: list[Events] = []
        try:
            events = self._feed.poll()
        except Exception as error:
            return self._log_notes(self._lose(error))
        if self._lost_at is not None and (events or not self._feed.event_series):
            events.append(self._log_return(events))
        return self._log_notes(events)

    def request_end(self) -> None:
        """Let the device's threads end, without waiting for them."""
        self._stopped.set()
        if isinstance(self._feed, ThreadedFeed):
            self._feed.request_end()

    def conclude(self) -> list[Events]:
        """Return the last events, and the device's notes on the complete recording."""
        self._end_attempts()
        if isinstance(self._feed, NotingFeed):
            self._feed.conclude()
        if isinstance(self._feed, Finishes):  # events of samples that still wait belong to the recording
            self._feed.finish()
        return self.poll()

    def _log_notes(self, events: list[Events]) -> list[Events]:
        if isinstance(self._feed, NotingFeed):
            events += [device_event(note_time, NOTE, text, self._log) for note_time, text in self._feed.notes()]
        return events

    def _lose(self, error: Exception) -> list[Events]:
        """Start to reconnect; return the entry for the log unless the device was lost before."""
        self._is_open = False
        self._end_attempts()
        self._stopped.clear()
        self._reconnecting = threading.Thread(target=self._reconnect, name=f"{self.where} again", daemon=True)
        self._reconnecting.start()
        if self._lost_at is not None:
            return []
        since = error.since if isinstance(error, DeviceTimeout) else None
        self._lost_at = time.monotonic() if since is None else since
        return [device_event(self._lost_at, LOST, f"{self.where}: lost ({self._reason(error)})", self._log)]

    def _log_return(self, events: list[Events]) -> Events:
        """Return the entry for the log of a device that is back: the loss ends with its first value."""
        first_times = [float((e.times if e.arrivals is None else e.arrivals)[0]) for e in events]
        self._lost_at = None
        return device_event(min([time.monotonic(), *first_times]), BACK, f"{self.where}: back", self._log)

    def _reconnect(self) -> None:
        """Try to open the device until it is back or the recording ends."""
        feed = self._feed
        drop, reopen = (feed.drop, feed.reopen) if isinstance(feed, NotingFeed) else (feed.close, feed.open)
        while not self._stopped.is_set():
            with suppress(Exception):
                drop()
            with suppress(Exception):
                reopen()
                if self._stopped.is_set():  # too late: nobody reads it any more
                    feed.close()
                    return
                self._is_open = True
                return
            self._stopped.wait(self._retry)

    def _reason(self, error: Exception) -> str:
        """Return the text of the error without the name of the device and without the remedy, which no longer helps."""
        text = str(error) if isinstance(error, MillfrfError) else f"{type(error).__name__}: {error}"
        return " ".join(text.split(";")[0].split()).removeprefix(self.where).lstrip(": ") or type(error).__name__

    def close(self) -> None:
        self._end_attempts()
        with suppress(Exception):
            self._feed.close()

    def _end_attempts(self) -> None:
        self._stopped.set()
        if self._reconnecting is not None:
            self._reconnecting.join(SETTINGS.stop_time)
            self._reconnecting = None


class WithFeeds(SourceWrapper):
    """A source whose blocks are interleaved with the events of feeds.

    Feeds are opened first, in their order, and closed last. During the recording only the source can end it: a feed
    that fails, falls silent or is unplugged is logged in the series `devices`, reopened, and logged when it is back.
    Steps of the host's wall clock are logged, too; all times are taken from the monotonic clock.

    Parameters
    ----------
    source
        Source of samples; it sets the pace.
    feeds
        Feeds of events, in the order in which they are opened.
    retry : s
        Time between two attempts to reconnect a lost feed.

    Raises
    ------
    InputError
        Two devices give a series of the same name.
    """

    def __init__(
        self, source: Source, feeds: Sequence[EventFeed], *, retry: float = SETTINGS.reconnection_interval
    ) -> None:
        super().__init__(source)
        self._pending: deque[Block | Events] = deque()
        self._error: MillfrfError | None = None
        self._opened = ExitStack()
        self._ended = self._finishing = False
        self.event_series: dict[str, EventAxis] = announced_events(source)
        self._logs_steps = not isinstance(source, WithFeeds)  # else the wrapped source logs them
        self._wall_clock = WallClock()
        # A replayed recording may bring a log on another axis; it keeps its name.
        present_axis = self.event_series.get(DEVICES, DEVICES_AXIS)
        self._log = DEVICES if present_axis == DEVICES_AXIS else f"{DEVICES}_while_replaying"
        self.event_series[self._log] = DEVICES_AXIS
        for feed in feeds:
            repeated = sorted(set(self.event_series) & set(feed.event_series))
            if repeated:
                raise InputError(f"event series {', '.join(repeated)} comes from two devices; give unique names")
            self.event_series.update(feed.event_series)
        self._feeds = tuple(ReconnectingFeed(feed, self._log, retry) for feed in feeds)

    def open(self) -> None:
        """Open the feeds, then the source; if one fails, close those opened before."""
        self.close()
        with ExitStack() as stack:
            devices: tuple[ReconnectingFeed | Source, ...] = (*self._feeds, self._source)
            for device in devices:
                stack.callback(device.close)
                device.open()
            stack.callback(sys.setswitchinterval, sys.getswitchinterval())
            sys.setswitchinterval(SETTINGS.switch_interval)
            self._opened = stack.pop_all()
        self._ended = self._finishing = False
        self._error = None
        self._wall_clock = WallClock()
        self._pending.clear()

    def read(self) -> Block | Events | None:
        """Return the next block or event; after the end of the source the last events, then None.

        Raises
        ------
        DeviceError
            Error of the source, raised after all earlier blocks and events were returned.
        """
        if not self._pending and not self._ended:
            self._read_all()
        if not self._pending and self._error is not None:
            raise self._error
        return self._pending.popleft() if self._pending else None

    def finish(self) -> None:
        """End the recording in order: the next reads return the last events of the feeds, then None."""
        self._finishing = True
        if isinstance(self._source, Finishes):
            self._source.finish()

    def _read_all(self) -> None:
        """Read a block or the end of the source, and the events since the last block."""
        item = None
        try:
            if not self._finishing or isinstance(self._source, Finishes):
                item = self._source.read()
        except MillfrfError as error:  # raised by `read` when everything before it was given
            self._error = error
        if item is not None:
            self._pending.append(item)
        self._ended = item is None
        step = self._wall_clock.step()
        if step and self._logs_steps:
            text = f"computer: wall clock set by {step:+.3f} s"
            self._pending.append(device_event(time.monotonic(), NOTE, text, self._log))
        if self._ended:
            for feed in self._feeds:  # together, so that several slow devices delay the end no longer than one
                feed.request_end()
        events = [feed.conclude() if self._ended else feed.poll() for feed in self._feeds]
        self._pending.extend(_merged(itertools.chain.from_iterable(events)))

    def close(self) -> None:
        """Close the feeds and the source."""
        self._opened.close()


def _merged(events: Iterable[Events]) -> list[Events]:
    """Join the events of each series: a file takes many values at once much faster than one by one."""
    by_series: dict[str, list[Events]] = {}
    for event in events:
        by_series.setdefault(event.series, []).append(event)
    return [parts[0] if len(parts) == 1 else _joined(parts) for parts in by_series.values()]


def _joined(parts: Sequence[Events]) -> Events:
    arrivals = [part.arrivals for part in parts if part.arrivals is not None]
    texts = [part.texts for part in parts if part.texts is not None]
    return Events(
        parts[0].series,
        np.concatenate([part.times for part in parts]),
        np.concatenate([part.values for part in parts]),
        np.concatenate(arrivals) if arrivals else None,
        tuple(itertools.chain.from_iterable(texts)) if texts else None,
    )
