"""A sampled source together with feeds of events: one source to record from."""

import time
from collections import deque
from collections.abc import Iterable, Sequence
from contextlib import ExitStack

import numpy as np

from foundation import InputError, MillfrfError

from .around_source import AroundSource
from .device_log import DEVICES, DEVICES_AXIS, NOTE, device_event
from .enduring_feed import RETRY, EnduringFeed
from .event_feed import EventFeed
from .events import EventAxis, Events, announced_events
from .source import Block, Finishes, Source
from .wall_clock import WallClock


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
