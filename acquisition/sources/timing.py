"""Sources at the speed of their own clock, steady time stamps, and the wall clock of the host."""

import math
import time
from collections import deque
from dataclasses import dataclass

from millfrf.core import InputError

from .source import AroundSource, Block, EventAxis, Events, Source, announced_events


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


TOLERANCE = 0.03
"""s; a lateness that differs by less from the usual one is no step."""

STEADY_STAMPS_LEAST_STEP = 0.1
"""s; what nobody announced is taken for a step from here on."""

_WAIT = 1.0
_MOST_WAIT = 5.0
_FEWEST = 3
_BUCKET = 5.0
_BUCKETS = 3
_REMEMBERED = 10.0


@dataclass(frozen=True)
class Stamped:
    """A value with the device's stamp and the host's arrival time.

    Parameters
    ----------
    series
        Name of its event series.
    value
        Value of the series, in its unit.
    stamp, arrival : s
        Reading of the device's clock, and the host's monotonic time at which the value was there.
    """

    series: str
    value: float
    stamp: float
    arrival: float


class SteadyStamps:
    """Passes values on with stamps of a clock that never steps.

    Values whose lateness is unusual are held until it is clear whether the clock stepped or the host was busy, some
    seconds at most.
    """

    def __init__(self) -> None:
        self._shift = 0.0
        self._shift_before: tuple[float, float] | None = None
        self._least: deque[tuple[float, float]] = deque(maxlen=_BUCKETS)
        self._held: list[Stamped] = []
        self._announced: list[tuple[float, float]] = []
        self._steps: list[tuple[float, float]] = []

    def announce(self, step: float, now: float) -> None:
        """The host's wall clock was set by ``step`` (s) at ``now``; whether the stamps follow it is seen by itself."""
        self._announced.append((now, step))

    def steps(self) -> list[tuple[float, float]]:
        """Steps that were taken out since the last call: host's time and size, s."""
        found, self._steps = self._steps, []
        return found

    def add(self, one: Stamped) -> list[Stamped]:
        """Take a value; return those that are clear by now, with steady stamps."""
        late = one.arrival - one.stamp - self._shift
        usual = self._usual()
        if usual is None or abs(late - usual) <= TOLERANCE:
            clear = [*self._released(self._shift), self._shifted(one, self._shift)]
            self._remember(one.arrival, late)
            return clear
        if self._shift_before is not None and self._fits_before(one, usual):
            return [self._shifted(one, self._shift_before[1])]
        for at, step in self._announced:
            if one.arrival - at < _REMEMBERED and abs(late + step - usual) <= TOLERANCE:
                self._take_out(step, one.arrival)
                return [*self._released(self._shift), self._shifted(one, self._shift)]
        self._held.append(one)
        return self._decided(usual)

    def flush(self) -> list[Stamped]:
        """Give whatever is held, with the best guess at the end of a recording."""
        usual = self._usual()
        return [] if not self._held or usual is None else self._decided(usual, last=True)

    def _decided(self, usual: float, last: bool = False) -> list[Stamped]:
        """What is held, once it is clear what happened."""
        span = self._held[-1].arrival - self._held[0].arrival
        enough = span >= _WAIT and len(self._held) >= _FEWEST
        if not (enough or last):
            return []
        lateness = sorted(one.arrival - one.stamp - self._shift for one in self._held)
        level, middle = lateness[0], lateness[len(lateness) // 2]
        alike = middle - level <= TOLERANCE or abs(level - usual) > _MOST_WAIT
        if not alike and not last and span < _MOST_WAIT:
            return []  # it still changes: a busy host
        if abs(level - usual) >= STEADY_STAMPS_LEAST_STEP and alike:
            self._take_out(usual - level, self._held[0].arrival)
        else:
            self._least.clear()
        clear = self._released(self._shift)
        for one in clear[-1:]:
            self._remember(one.arrival, usual if self._least else level)
        return clear

    def _take_out(self, step: float, now: float) -> None:
        self._shift_before = (now, self._shift)
        self._shift -= step
        self._steps.append((now, step))
        self._announced = [entry for entry in self._announced if entry[1] != step]

    def _fits_before(self, one: Stamped, usual: float) -> bool:
        """Whether a value was stamped before the last step and came after it."""
        assert self._shift_before is not None
        at, shift = self._shift_before
        return one.arrival - at < _REMEMBERED and abs(one.arrival - one.stamp - shift - usual) <= TOLERANCE

    def _released(self, shift: float) -> list[Stamped]:
        held, self._held = self._held, []
        return [self._shifted(one, shift) for one in held]

    @staticmethod
    def _shifted(one: Stamped, shift: float) -> Stamped:
        return Stamped(one.series, one.value, one.stamp + shift, one.arrival)

    def _usual(self) -> float | None:
        return min((late for _, late in self._least), default=None)

    def _remember(self, arrival: float, late: float) -> None:
        """Keep the least lateness of each of the last few stretches of seconds; clocks drift."""
        if self._least and arrival - self._least[-1][0] < _BUCKET:
            begun, least = self._least[-1]
            self._least[-1] = (begun, min(least, late))
        else:
            self._least.append((arrival, late))


WALL_CLOCK_LEAST_STEP = 0.02
"""s; a time service slews a clock by less than this between two looks, larger changes are steps."""


class WallClock:
    """Tells by how much the wall clock was set while a recording runs.

    Every time in a recording stands on the monotonic clock, which nobody can set. Some interfaces stamp what they
    receive with the wall clock; there a step matters.
    """

    def __init__(self) -> None:
        self._offset = _offset()

    def step(self) -> float:
        """Seconds by which the wall clock was set since the last call; 0 where it was not."""
        now = _offset()
        change, self._offset = now - self._offset, now
        return change if abs(change) > WALL_CLOCK_LEAST_STEP else 0.0


def _offset() -> float:
    """Wall clock less monotonic clock, s; the least held up of three readings counts."""
    found = []
    for _ in range(3):
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        found.append((after - before, wall - 0.5 * (before + after)))
    return min(found)[1]
