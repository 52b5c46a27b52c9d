"""Replay of a recording file, in real time or as fast as it can be read."""

import math
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..recordings.recording import Recording
from ..settings import SETTINGS
from ..sources.source import Block, EventAxis, Events, StreamDescription
from ..sources.timing import Pace


class ReplaySource:
    """A recording as a source: the blocks of its streams and its events, in the order of time.

    Event times are on the axis of the samples. ``speed`` is the factor over real time; infinity: as fast as the file
    can be read. The file is checked at once.
    """

    def __init__(self, path: str | os.PathLike[str], *, speed: float = math.inf, block_length: int = 4096) -> None:
        self._pace = Pace(speed)
        self._path = Path(path)
        with Recording(path) as recording:
            self.title = recording.title
            self.setup = recording.setup
            self.streams: tuple[StreamDescription, ...] = tuple(s.description for s in recording.streams.values())
            self.n_samples: int | None = sum(s.n_samples for s in recording.streams.values())
            self.event_series: dict[str, EventAxis] = {
                name: EventAxis(texts=series.axis.texts) for name, series in recording.events.items()
            }
        longest = {stream.name: SETTINGS.longest_wait * speed * stream.sample_rate for stream in self.streams}
        self._block_lengths = {name: max(int(min(rows, block_length)), 1) for name, rows in longest.items()}
        self._earliest = min(stream.start_time for stream in self.streams)
        self._recording: Recording | None = None
        self._next_rows: dict[str, int] = {}
        self._later: list[Events] = []
        self._due: list[Events] = []
        self._finishing = False

    def open(self) -> None:
        self.close()
        self._recording = Recording(self._path)
        self._next_rows = {stream.name: 0 for stream in self.streams}
        self._later = [
            Events(name, *series.read(), None, series.read_texts()) for name, series in self._recording.events.items()
        ]
        self._due = []
        self._finishing = False
        self._pace.start()

    def read(self) -> Block | Events | None:
        """Return the block that ends first, then the events up to its end; None at the end."""
        if self._recording is None:
            return None
        if self._due:
            return self._due.pop(0)
        blocks = []
        for stream in self._recording.streams.values():
            start = self._next_rows[stream.name]
            stop = min(start + self._block_lengths[stream.name], stream.n_samples)
            if stop > start:
                blocks.append((stream.start_time + stop / stream.sample_rate, stream.name, start, stop))
        if not blocks:
            self._take_events(math.inf)
            return self._due.pop(0) if self._due else None
        if self._finishing:
            return None
        end, name, start, stop = min(blocks)
        self._next_rows[name] = stop
        self._take_events(end)
        samples = self._recording.streams[name].read(start, stop)
        return Block(name, start, samples, self._pace.wait_until(end - self._earliest))

    def finish(self) -> None:
        """End in order: the next reads return the events up to the end of the last block, then None.

        After the last block, they return all remaining events.
        """
        self._finishing = True

    def _take_events(self, end: float) -> None:
        """Make the events before ``end`` (s) due."""
        later: list[Events] = []
        for events in self._later:
            is_due = events.times < end
            for chosen, target in ((is_due, self._due), (~is_due, later)):
                if chosen.any():
                    target.append(_select(events, chosen))
        self._later = later
        self._due.sort(key=lambda events: float(events.times[0]))

    def close(self) -> None:
        if self._recording is not None:
            self._recording.close()
            self._recording = None


def _select(events: Events, chosen: NDArray[np.bool_]) -> Events:
    texts = None
    if events.texts is not None:
        texts = tuple(text for text, is_chosen in zip(events.texts, chosen, strict=True) if is_chosen)
    return Events(events.series, events.times[chosen], events.values[chosen], None, texts)
