r"""Stamps of a device's clock made steady: steps of that clock are found and taken out.

The lateness of a message is :math:`l = t - s`, with the host's monotonic time :math:`t` of its arrival and its stamp
:math:`s`. A message can be late, never early, and the least lateness of some seconds hardly changes. A step of the
clock changes it at once and for good, a busy host only for a while.
"""

from collections import deque
from dataclasses import dataclass

TOLERANCE = 0.03
"""s; a lateness that differs by less from the usual one is no step."""

LEAST_STEP = 0.1
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
        if abs(level - usual) >= LEAST_STEP and alike:
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
