"""Shaft angle from the pulses of a tachometer channel."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import InputError, Real


@dataclass(frozen=True)
class ShaftAngle:
    """Angle between the first and the last pulse.

    Parameters
    ----------
    first_sample
        Index of the sample of ``angle[0]``.
    angle : (n,), rad
        Zero at the first pulse, growing.
    pulse_times : (n_pulses,), s
        Since the first sample of the channel.
    """

    first_sample: int
    angle: Real
    pulse_times: Real


def pulse_times(
    samples: Real, sample_rate: float, *, low: float | None = None, high: float | None = None, delay: float = 0.0
) -> Real:
    """Times (s) at which a signal rises through ``high`` after it was below ``low``; a straight line between samples.

    Parameters
    ----------
    samples : (n,)
        Samples of the pulse channel, in any unit.
    sample_rate : Hz
        Samples a second.
    low, high
        Levels of the hysteresis; None: at 40 % and 60 % between the 1st and 99th percentile.
    delay : s
        Time by which the channel comes late behind those it is compared with; it is taken off the times.

    Raises
    ------
    InputError
        ``low`` is not below ``high``.
    """
    bottom, top = np.quantile(samples, (0.01, 0.99)) if len(samples) else (0.0, 1.0)
    low = bottom + 0.4 * (top - bottom) if low is None else low
    high = bottom + 0.6 * (top - bottom) if high is None else high
    if not low < high:
        raise InputError(f"tachometer levels {low:g} and {high:g} do not differ; is the sensor connected?")
    state = np.where(samples >= high, 1, np.where(samples <= low, -1, 0))
    decided = np.flatnonzero(state)
    rises = decided[1:][(state[decided][1:] == 1) & (state[decided][:-1] == -1)]
    before, after = samples[rises - 1], samples[rises]
    share = np.divide(high - before, after - before, out=np.zeros(len(rises)), where=after > before)
    times: Real = (rises - 1 + share) / sample_rate - delay
    return times


def shaft_angle(samples: Real, sample_rate: float, pulses_per_revolution: int = 1, *, delay: float = 0.0) -> ShaftAngle:
    r"""Angle at each sample between the first and the last pulse, monotone and smooth in between.

    ``delay`` is that of `pulse_times`.

    At pulse :math:`k` the angle is :math:`2\pi k/P`; between pulses it is a monotone cubic (Fritsch, Carlson 1980).

    Raises
    ------
    InputError
        Fewer than two pulses, or no pulse at all a revolution.
    """
    if pulses_per_revolution < 1:
        raise InputError(f"{pulses_per_revolution} pulses per revolution; give 1 or more")
    times = pulse_times(samples, sample_rate, delay=delay)
    if len(times) < 2:
        raise InputError(f"the tachometer channel has {len(times)} pulses; at least two are needed, check the sensor")
    first, last = int(np.ceil(times[0] * sample_rate)), int(np.floor(times[-1] * sample_rate))
    at_pulses = 2 * np.pi / pulses_per_revolution * np.arange(len(times))
    angle = scipy.interpolate.PchipInterpolator(times, at_pulses)(np.arange(first, last + 1) / sample_rate)
    return ShaftAngle(first, np.asarray(angle, dtype=float), times)
