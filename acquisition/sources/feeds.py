"""A sampled source together with feeds of events: one source to record from."""

from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Protocol, runtime_checkable

from foundation import InputError, MillfrfError

from .around_source import AroundSource
from .events import EventAxis, Events, announced_events
from .source import Block, Source


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


class WithFeeds(AroundSource):
    """A source whose blocks are interleaved with the events of some feeds.

    Feeds are opened first, in their order, and closed last.

    Parameters
    ----------
    source
        The source of samples; it sets the pace.
    feeds
        Feeds of events, in the order in which they are opened.

    Raises
    ------
    InputError
        Two give a series of one name.
    """

    def __init__(self, source: Source, feeds: Sequence[EventFeed]) -> None:
        super().__init__(source)
        self._feeds = tuple(feeds)
        self._waiting: deque[Block | Events] = deque()
        self._error: MillfrfError | None = None
        self._opened = ExitStack()
        self._ended = False
        self.event_series: dict[str, EventAxis] = announced_events(source)
        for feed in feeds:
            twice = sorted(set(self.event_series) & set(feed.event_series))
            if twice:
                raise InputError(f"event series {', '.join(twice)} comes from two devices; give unique names")
            self.event_series.update(feed.event_series)

    def open(self) -> None:
        """Open the feeds, then the source; what was opened is closed again where one fails."""
        self.close()
        with ExitStack() as stack:
            devices: tuple[EventFeed | Source, ...] = (*self._feeds, self._source)
            for device in devices:
                stack.callback(device.close)
                device.open()
            self._opened = stack.pop_all()
        self._ended, self._error = False, None
        self._waiting.clear()

    def read(self) -> Block | Events | None:
        """The next block or event; after the source's end the last events, then None.

        Raises
        ------
        DeviceError
            What the source or a feed raised, after everything that came before.
        """
        if not self._waiting and self._error is not None:
            raise self._error
        if not self._waiting and not self._ended:
            taken = self._source.read()
            if taken is None:
                self._ended = True
            else:
                self._waiting.append(taken)
            self._poll_feeds()
        return self._waiting.popleft() if self._waiting else None

    def _poll_feeds(self) -> None:
        """Fetch events; an error waits until what came before it has been given away."""
        for feed in self._feeds:
            try:
                self._waiting.extend(feed.poll())
            except MillfrfError as error:
                self._error = self._error or error

    def close(self) -> None:
        """Close the feeds and the source."""
        self._opened.close()
