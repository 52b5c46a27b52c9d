"""Any source at the speed of its own clock: blocks are held back until they would have been there."""

import math
import time

from foundation import InputError

from .around_source import AroundSource
from .events import EventAxis, Events, announced_events
from .source import Block, Source


class Pace:
    """A clock that runs ``speed`` times as fast as the host's.

    Parameters
    ----------
    speed
        1: real time; infinity: nothing ever waits.

    Raises
    ------
    InputError
        A speed that is not positive.
    """

    def __init__(self, speed: float) -> None:
        if not speed > 0:
            raise InputError(f"speed {speed!r} must be positive: 1 is real time")
        self._speed = speed
        self._started = math.nan

    def start(self) -> None:
        """The clock shows zero now."""
        self._started = time.monotonic()

    def wait_until(self, seconds: float) -> float:
        """Sleep until the clock shows ``seconds``; returns what it shows, counted from the host's time at its start.

        The times of a faster clock are stretched as its samples are: they tell the rate that the samples have. NaN
        where nothing waits.
        """
        if math.isinf(self._speed):
            return math.nan
        wait = self._started + seconds / self._speed - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        return self._started + self._speed * (time.monotonic() - self._started)


class Paced(AroundSource):
    """A source that delivers no block before its last sample's time.

    Parameters
    ----------
    source
        Source of any kind.
    speed
        Factor over real time. 1: real time; 10: ten times faster; infinity: as fast as it comes.

    Raises
    ------
    InputError
        A speed that is not positive.
    """

    def __init__(self, source: Source, speed: float = 1.0) -> None:
        super().__init__(source)
        self._pace = Pace(speed)
        self._rates = {stream.name: stream.sample_rate for stream in source.streams}

    def open(self) -> None:
        """Open the source and start the clock."""
        self._source.open()
        self._pace.start()

    @property
    def event_series(self) -> dict[str, EventAxis]:
        """The source's event series."""
        return announced_events(self._source)

    def read(self) -> Block | Events | None:
        """The next block, not before its time; events at once."""
        block = self._source.read()
        if block is None or isinstance(block, Events):
            return block
        end = (block.first_sample + len(block.samples)) / self._rates[block.stream]
        now = self._pace.wait_until(end)
        return block if math.isnan(now) else Block(block.stream, block.first_sample, block.samples, now)

    def close(self) -> None:
        """Close the source."""
        self._source.close()
