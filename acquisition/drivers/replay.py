"""Replay of a recording file, in real time or as fast as it can be read."""

import math
import os
from pathlib import Path

from ..pacing import Pace
from ..recording import Recording
from ..source import Block, StreamDescription


class ReplaySource:
    """A recording as a source: its streams' blocks in the order of their times.

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
        self._earliest = min(stream.start_time for stream in self.streams)
        self._recording: Recording | None = None
        self._next: dict[str, int] = {}

    def open(self) -> None:
        """Open the file at its beginning."""
        self.close()
        self._recording = Recording(self._path)
        self._next = {stream.name: 0 for stream in self.streams}
        self._pace.start()

    def read(self) -> Block | None:
        """The block whose end comes first in time, or None at the end."""
        if self._recording is None:
            return None
        due = []
        for stream in self._recording.streams.values():
            start = self._next[stream.name]
            stop = min(start + self._block_length, stream.n_samples)
            if stop > start:
                due.append((stream.start_time + stop / stream.sample_rate, stream.name, start, stop))
        if not due:
            return None
        end, name, start, stop = min(due)
        self._next[name] = stop
        samples = self._recording.streams[name].read(start, stop)
        return Block(name, start, samples, self._pace.wait_until(end - self._earliest))

    def close(self) -> None:
        """Close the file."""
        if self._recording is not None:
            self._recording.close()
            self._recording = None
