"""Replay of a recording file, in real time or as fast as it can be read."""

import math
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..recordings.recording import Recording
from ..sources.source import Block, EventAxis, Events, StreamDescription
from ..sources.timing import Pace


class ReplaySource:
    """A recording as a source: its streams' blocks and its events, on the axis of the samples, in the order of time.

    Parameters
    ----------
    path
        A recording; checked at once.
    speed
        1: real time; infinity: as fast as it can be read.
    block_length
        Rows in a block.

    Raises
    ------
    InputError, FileFormatError
        The file cannot be used.
    """

    def __init__(self, path: str | os.PathLike[str], *, speed: float = math.inf, block_length: int = 4096) -> None:
        self._pace = Pace(speed)
        self._path = Path(path)
        self._block_length = block_length
        with Recording(path) as recording:
            self.title = recording.title
            self.setup = recording.setup
            self.streams: tuple[StreamDescription, ...] = tuple(s.description for s in recording.streams.values())
            self.n_samples: int | None = sum(s.n_samples for s in recording.streams.values())
            self.event_series: dict[str, EventAxis] = {
                name: EventAxis(texts=series.axis.texts) for name, series in recording.events.items()
            }
        self._earliest = min(stream.start_time for stream in self.streams)
        self._recording: Recording | None = None
        self._next: dict[str, int] = {}
        self._events: list[Events] = []
        self._due: list[Events] = []
        self._finishing = False

    def open(self) -> None:
        """Open the file at its beginning."""
        self.close()
        self._recording = Recording(self._path)
        self._next = {stream.name: 0 for stream in self.streams}
        self._events = [
            Events(name, *series.read(), None, series.read_texts()) for name, series in self._recording.events.items()
        ]
        self._due = []
        self._finishing = False
        self._pace.start()

    def read(self) -> Block | Events | None:
        """The block whose end comes first in time, after it the events up to its end; None at the end."""
        if self._recording is None:
            return None
        if self._due:
            return self._due.pop(0)
        due = []
        for stream in self._recording.streams.values():
            start = self._next[stream.name]
            stop = min(start + self._block_length, stream.n_samples)
            if stop > start:
                due.append((stream.start_time + stop / stream.sample_rate, stream.name, start, stop))
        if not due:
            self._take_events(math.inf)
            return self._due.pop(0) if self._due else None
        if self._finishing:
            return None
        end, name, start, stop = min(due)
        self._next[name] = stop
        self._take_events(end)
        samples = self._recording.streams[name].read(start, stop)
        return Block(name, start, samples, self._pace.wait_until(end - self._earliest))

    def finish(self) -> None:
        """End the replay in order: the events up to the last block's end, or all where no sample is left, then None."""
        self._finishing = True

    def _take_events(self, end: float) -> None:
        """Events before ``end``, s, become due; the others stay."""
        later: list[Events] = []
        for events in self._events:
            now = events.times < end
            for chosen, part in ((now, self._due), (~now, later)):
                if chosen.any():
                    part.append(_part(events, chosen))
        self._events = later
        self._due.sort(key=lambda events: float(events.times[0]))

    def close(self) -> None:
        """Close the file."""
        if self._recording is not None:
            self._recording.close()
            self._recording = None


def _part(events: Events, chosen: NDArray[np.bool_]) -> Events:
    texts = None if events.texts is None else tuple(t for t, wanted in zip(events.texts, chosen, strict=True) if wanted)
    return Events(events.series, events.times[chosen], events.values[chosen], None, texts)
