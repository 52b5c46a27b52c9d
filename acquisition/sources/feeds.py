"""A sampled source combined with feeds of events that are allowed to fail and reconnect."""

import threading
import time
from collections import deque
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError, MillfrfError

from ..errors import DeviceTimeout
from .source import AroundSource, Block, EventAxis, EventFeed, Events, Finishes, Source, TellsNotes, announced_events
from .timing import WallClock

DEVICES = "devices"
"""Name of the series."""

DEVICES_AXIS = EventAxis("host", texts=True)
"""Its times are those of the host's monotonic clock."""

LOST, BACK, NOTE, FAULT, CLEARED = 0.0, 1.0, 2.0, 3.0, 4.0
"""Values of the series: a device was lost, it is back; something was noticed; an input is at fault (an overload, an
open loop), it is well again."""


def device_event(time: float, value: float, text: str, series: str = DEVICES) -> Events:
    """One line of the log at a host's time (s), with its text."""
    return Events(series, np.array([time]), np.array([value]), None, (text,))


@dataclass(frozen=True)
class DeviceStory:
    """What happened to auxiliary devices during a recording, one sentence each.

    Parameters
    ----------
    losses
        Devices that were lost and inputs that were at fault, with time and reason, and when it was over.
    notices
        Whatever else was noticed: a clock that was set, packets that were lost.
    """

    losses: tuple[str, ...] = ()
    notices: tuple[str, ...] = ()


def device_story(times: NDArray[np.float64], values: NDArray[np.float64], texts: Sequence[str]) -> DeviceStory:
    """Tell the log in sentences.

    Parameters
    ----------
    times : (n,), s
        Times of the log's lines, on any one axis.
    values : (n,)
        `LOST`, `BACK`, `NOTE`, `FAULT` or `CLEARED`.
    texts
        Text of each line, which begins with the device and a colon.

    Examples
    --------
    >>> log = ("CAN bus can0: lost (silent)", "CAN bus can0: back")
    >>> device_story(np.array([2.0, 5.5]), np.array([LOST, BACK]), log).losses
    ('CAN bus can0: lost (silent) at 2.00 s, back after 3.50 s',)
    """
    standing: dict[str, tuple[float, int]] = {}
    losses: list[str] = []
    notices: list[str] = []
    for when, value, text in zip(times, values, texts, strict=True):
        subject = text.split(": lost")[0].split(": back")[0]
        if value in (LOST, FAULT):
            standing[subject] = (float(when), len(losses))
            losses.append(f"{text} at {when:.2f} s")
        elif value in (BACK, CLEARED):
            begun, line = standing.pop(subject, (float(when), -1))
            if line >= 0:
                losses[line] += f", {'back' if value == BACK else 'over'} after {when - begun:.2f} s"
        else:
            notices.append(f"{text} ({when:.2f} s)")
    for _, line in standing.values():
        losses[line] += ", until the end" if ": lost" not in losses[line] else ", not back until the end"
    return DeviceStory(tuple(losses), tuple(notices))


RETRY = 1.0
"""s between two attempts to bring a device back."""


class EnduringFeed:
    """A feed that gives the events of another one, and the log of its losses instead of its errors.

    Opening it is strict: what is missing before the cut is told before the cut.

    Parameters
    ----------
    feed
        The auxiliary device.
    log
        Name of the event series of the log.
    retry : s
        Time between two attempts to bring it back.
    """

    def __init__(self, feed: EventFeed, log: str = DEVICES, retry: float = RETRY) -> None:
        self._feed, self._log, self._retry = feed, log, retry
        self.where = str(getattr(feed, "where", type(feed).__name__))
        self._stop = threading.Event()
        self._returning: threading.Thread | None = None
        self._lost_at: float | None = None
        self._is_open = False

    def open(self) -> None:
        """Open the device.

        Raises
        ------
        DeviceError, InputError
            It is not there or not as it should be.
        """
        self._stop.clear()
        self._lost_at = None
        self._feed.open()
        self._is_open = True

    def poll(self) -> list[Events]:
        """Give the events since the last call and what there is to log; never waits and never fails."""
        if not self._is_open:
            return self._logged([])
        taken: list[Events] = []
        try:
            taken = self._feed.poll()
        except Exception as error:
            return self._logged(self._lose(error))
        if self._lost_at is not None and (taken or not self._feed.event_series):
            taken.append(self._found(taken))
        return self._logged(taken)

    def conclude(self) -> list[Events]:
        """Give the last events, and what the device has to tell of the whole recording."""
        self._end_attempts()
        if isinstance(self._feed, TellsNotes):
            self._feed.conclude()
        return self.poll()

    def _logged(self, taken: list[Events]) -> list[Events]:
        """The events together with the device's own notes."""
        if isinstance(self._feed, TellsNotes):
            taken += [device_event(at, NOTE, text, self._log) for at, text in self._feed.notes()]
        return taken

    def _lose(self, error: Exception) -> list[Events]:
        """Start to bring the device back; the log's line, where it was not lost before."""
        self._is_open = False
        self._end_attempts()
        self._stop.clear()
        self._returning = threading.Thread(target=self._bring_back, name=f"{self.where} again", daemon=True)
        self._returning.start()
        if self._lost_at is not None:
            return []
        since = error.since if isinstance(error, DeviceTimeout) else None
        self._lost_at = time.monotonic() if since is None else since
        return [device_event(self._lost_at, LOST, f"{self.where}: lost ({self._reason(error)})", self._log)]

    def _found(self, taken: list[Events]) -> Events:
        """The log's line of a device that is back: the loss ends with its first value."""
        there = [float((one.times if one.arrivals is None else one.arrivals)[0]) for one in taken]
        self._lost_at = None
        return device_event(min([time.monotonic(), *there]), BACK, f"{self.where}: back", self._log)

    def _bring_back(self) -> None:
        """Open the device again and again until it is there or the recording ends."""
        feed = self._feed
        drop, reopen = (feed.drop, feed.reopen) if isinstance(feed, TellsNotes) else (feed.close, feed.open)
        while not self._stop.is_set():
            with suppress(Exception):
                drop()
            with suppress(Exception):
                reopen()
                self._is_open = True
                return
            self._stop.wait(self._retry)

    def _reason(self, error: Exception) -> str:
        """The error without the device's name and without the remedy, which no longer helps."""
        text = str(error) if isinstance(error, MillfrfError) else f"{type(error).__name__}: {error}"
        return " ".join(text.split(";")[0].split()).removeprefix(self.where).lstrip(": ") or type(error).__name__

    def close(self) -> None:
        """End the attempts and release the device."""
        self._end_attempts()
        with suppress(Exception):
            self._feed.close()

    def _end_attempts(self) -> None:
        self._stop.set()
        if self._returning is not None:
            self._returning.join()
            self._returning = None


class WithFeeds(AroundSource):
    """A source whose blocks are interleaved with the events of some feeds.

    Feeds are opened first, in their order, and closed last. While it runs only the source can end it: a feed that
    fails, falls silent or is unplugged is logged in the series `devices`, tried again, and logged when it is back. A
    step of the host's wall clock is logged, too; all times stand on the monotonic clock.

    Parameters
    ----------
    source
        The source of samples; it sets the pace.
    feeds
        Feeds of events, in the order in which they are opened.
    retry : s
        Time between two attempts to bring a lost feed back.

    Raises
    ------
    InputError
        Two give a series of one name.
    """

    def __init__(self, source: Source, feeds: Sequence[EventFeed], *, retry: float = RETRY) -> None:
        super().__init__(source)
        self._waiting: deque[Block | Events] = deque()
        self._error: MillfrfError | None = None
        self._opened = ExitStack()
        self._ended = self._finishing = False
        self.event_series: dict[str, EventAxis] = announced_events(source)
        self._watching = not isinstance(source, WithFeeds)  # else the one within watches the wall clock
        self._wall_clock = WallClock()
        there = self.event_series.get(DEVICES, DEVICES_AXIS)
        self._log = DEVICES if there == DEVICES_AXIS else f"{DEVICES}_while_replaying"
        self.event_series[self._log] = DEVICES_AXIS
        for feed in feeds:
            twice = sorted(set(self.event_series) & set(feed.event_series))
            if twice:
                raise InputError(f"event series {', '.join(twice)} comes from two devices; give unique names")
            self.event_series.update(feed.event_series)
        self._feeds = tuple(EnduringFeed(feed, self._log, retry) for feed in feeds)

    def open(self) -> None:
        """Open the feeds, then the source; what was opened is closed again where one fails."""
        self.close()
        with ExitStack() as stack:
            devices: tuple[EnduringFeed | Source, ...] = (*self._feeds, self._source)
            for device in devices:
                stack.callback(device.close)
                device.open()
            self._opened = stack.pop_all()
        self._ended = self._finishing = False
        self._error = None
        self._wall_clock = WallClock()
        self._waiting.clear()

    def read(self) -> Block | Events | None:
        """The next block or event; after the source's end the last events, then None.

        Raises
        ------
        DeviceError
            What the source raised, after everything that came before.
        """
        if not self._waiting and not self._ended:
            self._take()
        if not self._waiting and self._error is not None:
            raise self._error
        return self._waiting.popleft() if self._waiting else None

    def finish(self) -> None:
        """End the recording in order: the next reads give what the feeds still have to tell, then None."""
        self._finishing = True
        if isinstance(self._source, Finishes):
            self._source.finish()

    def _take(self) -> None:
        """A block or the end of the source, and the events that came meanwhile."""
        taken = None
        try:
            if not self._finishing or isinstance(self._source, Finishes):
                taken = self._source.read()
        except MillfrfError as error:  # it is raised when what came before has been given away
            self._error = error
        if taken is not None:
            self._waiting.append(taken)
        self._ended = taken is None
        step = self._wall_clock.step()
        if step and self._watching:
            text = f"computer: wall clock set by {step:+.3f} s"
            self._waiting.append(device_event(time.monotonic(), NOTE, text, self._log))
        came = [feed.conclude() if self._ended else feed.poll() for feed in self._feeds]
        self._waiting.extend(_merged(one for events in came for one in events))

    def close(self) -> None:
        """Close the feeds and the source."""
        self._opened.close()


def _merged(events: Iterable[Events]) -> list[Events]:
    """Events of one series as one: a file takes many values at once much faster than one by one."""
    by_series: dict[str, list[Events]] = {}
    for one in events:
        by_series.setdefault(one.series, []).append(one)
    return [parts[0] if len(parts) == 1 else _joined(parts) for parts in by_series.values()]


def _joined(parts: Sequence[Events]) -> Events:
    arrivals = [part.arrivals for part in parts if part.arrivals is not None]
    texts = [part.texts for part in parts if part.texts is not None]
    return Events(
        parts[0].series,
        np.concatenate([part.times for part in parts]),
        np.concatenate([part.values for part in parts]),
        np.concatenate(arrivals) if arrivals else None,
        tuple(text for each in texts for text in each) if texts else None,
    )
