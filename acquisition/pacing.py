"""Any source at the speed of its own clock: blocks are held back until they would have been there."""

import math
import time

from foundation import InputError

from .source import Block, Source, StreamDescription


class Paced:
    """A source that delivers no block before its last sample's time.

    Parameters
    ----------
    source
        Any source.
    speed
        1: real time; 10: ten times faster; infinity: as fast as it comes.

    Raises
    ------
    InputError
        A speed that is not positive.
    """

    def __init__(self, source: Source, speed: float = 1.0) -> None:
        if not speed > 0:
            raise InputError(f"speed {speed!r} must be positive: 1 is real time")
        self._source = source
        self._speed = speed
        self._rates = {stream.name: stream.sample_rate for stream in source.streams}
        self._started = math.nan

    @property
    def title(self) -> str:
        """The source's title."""
        return self._source.title

    @property
    def setup(self) -> str:
        """The source's setup."""
        return self._source.setup

    @property
    def streams(self) -> tuple[StreamDescription, ...]:
        """The source's streams."""
        return self._source.streams

    @property
    def n_samples(self) -> int | None:
        """The source's number of samples."""
        return self._source.n_samples

    def open(self) -> None:
        """Open the source and start the clock."""
        self._source.open()
        self._started = time.monotonic()

    def read(self) -> Block | None:
        """The next block, not before its time."""
        block = self._source.read()
        if block is None or math.isinf(self._speed):
            return block
        last = block.first_sample + len(block.samples)
        wait = self._started + last / self._rates[block.stream] / self._speed - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        return Block(block.stream, block.first_sample, block.samples, time.monotonic())

    def close(self) -> None:
        """Close the source."""
        self._source.close()
