"""Shaft angle from the pulses of a tachometer channel."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import InputError, Real


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
