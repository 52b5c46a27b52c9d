"""Replay of a recording file, as fast as it can be read; wrap it in `Paced` for real time."""

import os
from pathlib import Path

from ..recording import Recording
from ..source import Block, StreamDescription


class ReplaySource:
    """A recording as a source: its streams' blocks in the order of their times.

    Parameters
    ----------
    path
        A recording; checked at once.
    block_length
        Rows in a block.

    Raises
    ------
    InputError, FileFormatError
        The file cannot be used.
    """

    def __init__(self, path: str | os.PathLike[str], *, block_length: int = 4096) -> None:
        self._path = Path(path)
        self._block_length = block_length
        with Recording(path) as recording:
            self.title = recording.title
            self.setup = recording.setup
            self.streams: tuple[StreamDescription, ...] = tuple(s.description for s in recording.streams.values())
            self.n_samples: int | None = sum(s.n_samples for s in recording.streams.values())
        self._recording: Recording | None = None
        self._next: dict[str, int] = {}

    def open(self) -> None:
        """Open the file at its beginning."""
        self.close()
        self._recording = Recording(self._path)
        self._next = {stream.name: 0 for stream in self.streams}

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
        _, name, start, stop = min(due)
        self._next[name] = stop
        return Block(name, start, self._recording.streams[name].read(start, stop))

    def close(self) -> None:
        """Close the file."""
        if self._recording is not None:
            self._recording.close()
            self._recording = None
