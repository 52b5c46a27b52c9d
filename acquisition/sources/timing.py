"""Sources that keep the pace of their sample clock, stamps of clocks that step, and the angle of a shaft by pulses."""

import math
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..settings import SETTINGS
from .source import Block, EventAxis, Events, Source, SourceWrapper, announced_events


class Pace:
    """A clock that runs ``speed`` times as fast as the host's; at infinite speed nothing ever waits."""

    def __init__(self, speed: float) -> None:
        if not speed > 0:
            raise InputError(f"speed {speed!r} must be positive: 1 is real time")
        self._speed = speed
        self._started = math.nan

    def start(self) -> None:
        """Set the clock to zero."""
        self._started = time.monotonic()

    def wait_until(self, seconds: float) -> float:
        """Sleep until the clock shows ``seconds``; return the host's time at the start plus the time of the clock, s.

        With a faster clock the returned times are stretched like the samples, so that they agree with the sample rate.
        At infinite speed the result is NaN.
        """
        if math.isinf(self._speed):
            return math.nan
        wait = self._started + seconds / self._speed - time.monotonic()
        if wait > 0:
            time.sleep(wait)
        return self._started + self._speed * (time.monotonic() - self._started)


class Paced(SourceWrapper):
    """A source that gives no block before the time of its last sample.

    Parameters
    ----------
    source
        Source of any kind.
    speed
        Factor over real time. 1: real time; 10: ten times faster; infinity: without waiting.

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
        """Return the event series of the source."""
        return announced_events(self._source)

    def read(self) -> Block | Events | None:
        """Return the next block, not before its time; return events at once."""
        block = self._source.read()
        if block is None or isinstance(block, Events):
            return block
        end = (block.first_sample + len(block.samples)) / self._rates[block.stream]
        now = self._pace.wait_until(end)
        return block if math.isnan(now) else Block(block.stream, block.first_sample, block.samples, now)

    def close(self) -> None:
        """Close the wrapped source."""
        self._source.close()


@dataclass(frozen=True)
class StampedValue:
    """A value of an event series with the device's stamp (s) and the host's monotonic time of arrival (s)."""

    series: str
    value: float
    stamp: float
    arrival: float

    @property
    def lateness(self) -> float:
        return self.arrival - self.stamp


def to_events(values: Iterable[StampedValue]) -> list[Events]:
    """Group values by series, in their order; a file takes many values at once much faster than one by one."""
    by_series: dict[str, list[StampedValue]] = {}
    for value in values:
        by_series.setdefault(value.series, []).append(value)
    events = []
    for name, group in by_series.items():
        stamps, numbers, arrivals = np.array([(value.stamp, value.value, value.arrival) for value in group]).T
        events.append(Events(name, stamps, numbers, arrivals))
    return events


class SteadyStamps:
    """Corrects the stamps of a clock that may be set while it runs, such as the wall clock in most CAN interfaces.

    A message can be late, never early, and the least lateness hardly changes. If it changes suddenly and permanently,
    the clock was set, and the step is removed. Values of unusual lateness are held until it is clear whether the clock
    stepped or the host was busy, a few seconds at most.
    """

    def __init__(self) -> None:
        self._shift = 0.0  # correction of the stamps, s
        self._previous_shift: tuple[float, float] | None = None  # time of the last step, and the shift before it
        self._least_lateness: deque[tuple[float, float]] = deque(maxlen=SETTINGS.lateness_periods)
        self._held: list[StampedValue] = []
        self._next_decision = -math.inf  # time of arrival from which the held values are looked at again
        self._announced: list[tuple[float, float]] = []
        self._steps: list[tuple[float, float]] = []

    def announce(self, step: float, now: float) -> None:
        """Report that the host's wall clock was set by ``step`` (s) at ``now``; the stamps may follow it or not."""
        self._announced.append((now, step))

    def steps(self) -> list[tuple[float, float]]:
        """Return the steps that were removed since the last call: host's time and size, s."""
        steps, self._steps = self._steps, []
        return steps

    def add(self, value: StampedValue) -> list[StampedValue]:
        """Take a value; return the values whose stamps are certain by now, corrected."""
        late = value.lateness - self._shift
        usual = self._usual_lateness()
        if usual is None or abs(late - usual) <= SETTINGS.lateness_tolerance:
            clear = [*self._release(), self._shifted(value, self._shift)]
            self._remember(value.arrival, late)
            return clear
        if self._previous_shift is not None and self._is_from_before(value, self._previous_shift, usual):
            return [self._shifted(value, self._previous_shift[1])]
        for time_of_step, step in self._announced:
            recent = value.arrival - time_of_step < SETTINGS.step_memory
            if recent and abs(late + step - usual) <= SETTINGS.lateness_tolerance:
                self._remove_step(step, value.arrival)
                return [*self._release(), self._shifted(value, self._shift)]
        self._held.append(value)
        return self._decide(usual)

    def flush(self) -> list[StampedValue]:
        """Return the values that are still held at the end of a recording, corrected by the best guess."""
        usual = self._usual_lateness()
        return [] if not self._held or usual is None else self._decide(usual, at_end=True)

    def _decide(self, usual: float, at_end: bool = False) -> list[StampedValue]:
        """Release the held values once it is clear whether the clock stepped."""
        now = self._held[-1].arrival
        span = now - self._held[0].arrival
        at_end = at_end or len(self._held) >= SETTINGS.held_values
        enough = span >= SETTINGS.shortest_hold and len(self._held) >= SETTINGS.fewest_held
        if not at_end and (not enough or now < self._next_decision):
            return []
        self._next_decision = now + SETTINGS.decision_interval
        lateness = sorted(value.lateness - self._shift for value in self._held)
        level, median = lateness[0], lateness[len(lateness) // 2]
        tolerance, longest = SETTINGS.lateness_tolerance, SETTINGS.longest_hold
        constant = median - level <= tolerance or abs(level - usual) > longest
        if not constant and not at_end and span < longest:
            return []  # the lateness still changes, so the host is busy
        if abs(level - usual) >= SETTINGS.smallest_stamp_step and constant:
            self._remove_step(usual - level, self._held[0].arrival)
        else:
            self._least_lateness.clear()
        clear = self._release()
        if clear:
            self._remember(clear[-1].arrival, usual if self._least_lateness else level)
        return clear

    def _remove_step(self, step: float, now: float) -> None:
        self._previous_shift = (now, self._shift)
        self._shift -= step
        self._steps.append((now, step))
        self._announced = [entry for entry in self._announced if entry[1] != step]

    @staticmethod
    def _is_from_before(value: StampedValue, previous: tuple[float, float], usual: float) -> bool:
        """Return whether a value was stamped before the last step and arrived after it."""
        time_of_step, shift = previous
        recent = value.arrival - time_of_step < SETTINGS.step_memory
        return recent and abs(value.lateness - shift - usual) <= SETTINGS.lateness_tolerance

    def _release(self) -> list[StampedValue]:
        held, self._held = self._held, []
        return [self._shifted(value, self._shift) for value in held]

    @staticmethod
    def _shifted(value: StampedValue, shift: float) -> StampedValue:
        return replace(value, stamp=value.stamp + shift)

    def _usual_lateness(self) -> float | None:
        return min((late for _, late in self._least_lateness), default=None)

    def _remember(self, arrival: float, late: float) -> None:
        """Keep only the least lateness of each of the last periods, because clocks drift."""
        if self._least_lateness and arrival - self._least_lateness[-1][0] < SETTINGS.lateness_period:
            begun, least = self._least_lateness[-1]
            self._least_lateness[-1] = (begun, min(least, late))
        else:
            self._least_lateness.append((arrival, late))


class WallClock:
    """Detects that the host's wall clock was set while a recording runs.

    Times of a recording are those of the monotonic clock, which cannot be set. Some interfaces stamp what they receive
    with the wall clock, so that their stamps follow its steps.
    """

    def __init__(self) -> None:
        self._offset = _wall_clock_offset()

    def step(self) -> float:
        """Return the seconds by which the wall clock was set since the last call; 0 if it was not set."""
        now = _wall_clock_offset()
        change, self._offset = now - self._offset, now
        return change if abs(change) > SETTINGS.smallest_wall_clock_step else 0.0


def _wall_clock_offset() -> float:
    """Return wall clock minus monotonic clock, s, from the least interrupted of three readings."""
    readings = []
    for _ in range(3):
        before, wall, after = time.monotonic(), time.time(), time.monotonic()
        readings.append((after - before, wall - 0.5 * (before + after)))
    return min(readings)[1]


@dataclass(frozen=True)
class ShaftAngle:
    """Shaft angle between the first and the last pulse.

    Parameters
    ----------
    first_sample
        Index of the sample of ``angle[0]``.
    angle : (n,), rad
        Increasing angle, zero at the first pulse.
    pulse_times : (n_pulses,), s
        Times of the pulses since the first sample of the channel.
    """

    first_sample: int
    angle: Real
    pulse_times: Real


def pulse_times(samples: Real, sample_rate: float, *, delay: float = 0.0) -> Real:
    """Find the times (s) of the rising edges of a pulse signal, interpolated linearly between samples.

    The levels of the hysteresis are 40 % and 60 % between the 1st and 99th percentile of the samples. Percentiles are
    used because single spikes must not set the levels. ``delay`` (s) of the channel is subtracted.
    """
    bottom, top = np.quantile(samples, (0.01, 0.99)) if len(samples) else (0.0, 1.0)
    low, high = bottom + 0.4 * (top - bottom), bottom + 0.6 * (top - bottom)
    if not low < high:
        raise InputError(f"tachometer levels {low:g} and {high:g} do not differ; is the sensor connected?")
    state = np.where(samples >= high, 1, np.where(samples <= low, -1, 0))
    decided = np.flatnonzero(state)
    edges = decided[1:][(state[decided][1:] == 1) & (state[decided][:-1] == -1)]
    before, after = samples[edges - 1], samples[edges]
    fraction = np.divide(high - before, after - before, out=np.zeros(len(edges)), where=after > before)
    times: Real = (edges - 1 + fraction) / sample_rate - delay
    return times


def shaft_angle(samples: Real, sample_rate: float, pulses_per_revolution: int = 1, *, delay: float = 0.0) -> ShaftAngle:
    r"""Compute the shaft angle at each sample between the first and the last pulse.

    At pulse :math:`k` the angle is :math:`2\pi k/P`. A monotone cubic interpolates between pulses (Fritsch and Carlson,
    Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17, 1980).

    Parameters
    ----------
    samples : (n_samples,)
        Samples of the pulse channel, in any unit.
    sample_rate : Hz
        Samples per second.
    pulses_per_revolution
        Number of pulses :math:`P` per revolution.
    delay : s
        Time by which the channel lags behind the channels it is compared with.
    """
    if pulses_per_revolution < 1:
        raise InputError(f"{pulses_per_revolution} pulses per revolution; give 1 or more")
    times = pulse_times(samples, sample_rate, delay=delay)
    if len(times) < 2:
        raise InputError(f"the tachometer channel has {len(times)} pulses; at least two are needed, check the sensor")
    first, last = int(np.ceil(times[0] * sample_rate)), int(np.floor(times[-1] * sample_rate))
    pulse_angles = 2 * np.pi / pulses_per_revolution * np.arange(len(times))
    angle = scipy.interpolate.PchipInterpolator(times, pulse_angles)(np.arange(first, last + 1) / sample_rate)
    return ShaftAngle(first, np.asarray(angle, dtype=float), times)
