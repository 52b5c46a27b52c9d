"""Was the cut stable? Samples once per tooth tell a repeating motion from Hopf chatter and from period doubling."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from foundation import InputError

Real = NDArray[np.float64]
_PHASES = 8  # samples a tooth period
_FEWEST_PERIODS = 40
_SHARE = 0.05  # of the motion's size: what no longer dies out and is larger is chatter
_DECAY = 0.7  # last quarter over first quarter: what falls faster dies out
_ALTERNATING = 0.8  # of the deviation's power in the line at half the tooth passing


@dataclass(frozen=True)
class ChatterVerdict:
    """What a recording of a cut says.

    Parameters
    ----------
    kind
        ``stable``, ``hopf`` or ``period-doubling``.
    deviation
        Size of what does not repeat with the tooth (the revolution) over the size of the motion, in the last quarter.
    growth
        Deviation in the last quarter over that in the first.
    frequency
        Of the strongest line that is no harmonic of the tooth passing, Hz, known up to multiples of it; NaN if stable.
    """

    kind: str
    deviation: float
    growth: float
    frequency: float


def classify_cut(
    samples: Real, sample_rate: float, spindle_speed: float, teeth: int, *, runout: bool = True
) -> ChatterVerdict:
    """Classify a cut at constant speed from forces or vibration.

    The motion is sampled at eight fixed phases of every tooth (with ``runout``: of every revolution). Stable cutting
    repeats: the samples of one phase are equal but for noise. In Hopf chatter they wander on a closed curve; in
    period doubling they alternate between two values (Insperger, Mann, Stepan & Bayly, Int. J. Mach. Tools Manuf. 43,
    2003). The spindle's true speed is found from the samples first. What is left of the entry's transient falls over
    the record and is not taken for chatter.

    Parameters
    ----------
    samples : (n_samples, n_channels)
        From the time the tool is fully in the cut.
    sample_rate
        Hz.
    spindle_speed
        rad/s, within 1 %.
    teeth
        Number of teeth.
    runout
        Whether teeth may cut unequal chips: then deviations are taken from the mean over a revolution's phases. With
        two teeth, period doubling then looks like runout and is only seen while it grows.

    Raises
    ------
    InputError
        Fewer than 40 periods, or a speed that is not positive.
    """
    data = np.asarray(samples, dtype=float)
    if not spindle_speed > 0 or teeth < 1:
        raise InputError(f"spindle speed {spindle_speed:g} rad/s and {teeth} teeth must be positive")
    span = teeth if runout else 1
    period = 2 * math.pi * span / (teeth * spindle_speed)
    if len(data) < _FEWEST_PERIODS * period * sample_rate:
        raise InputError(
            f"{len(data) / sample_rate:.3g} s hold {len(data) / sample_rate / period:.0f} periods of "
            f"{period:.3g} s; {_FEWEST_PERIODS} are needed"
        )
    data = (data - data.mean(axis=0)) / np.maximum(data.std(axis=0), 1e-300)
    period = _true_period(data, sample_rate, period)
    strobed = _strobed(data, sample_rate, period)
    quarter = len(strobed) // 4
    parts = [part - part.mean(axis=0) for part in (strobed[:quarter], strobed[-quarter:])]
    first, last = (float(np.sqrt(np.mean(part**2))) for part in parts)
    size = float(np.sqrt(np.mean((data[-len(data) // 4 :]) ** 2)))
    deviation, growth = last / max(size, 1e-300), last / max(first, 1e-300)
    if deviation < _SHARE or growth < _DECAY:
        return ChatterVerdict("stable", deviation, growth, math.nan)
    frequency, alternating = _line(parts[1], period)
    kind = "period-doubling" if alternating > _ALTERNATING else "hopf"
    return ChatterVerdict(kind, deviation, growth, frequency)


def _strobed(data: Real, sample_rate: float, period: float) -> Real:
    """Samples at eight phases of each period, (n_periods, 8 n_channels)."""
    n = int((len(data) - 1) / sample_rate / period)
    times = (np.arange(n)[:, None] + np.arange(_PHASES) / _PHASES) * period
    spline = CubicSpline(np.arange(len(data)) / sample_rate, data)
    return np.asarray(spline(times).reshape(n, -1))


def _true_period(data: Real, sample_rate: float, period: float) -> float:
    """The period near the given one whose comb of harmonics holds most of the first half's power, to 1e-5."""
    half = data[: len(data) // 2]
    time = np.arange(len(half)) / sample_rate
    resolution = period / time[-1]
    candidates = period * (1 + np.arange(-0.012, 0.012, 0.25 * resolution))

    def power(trial: float) -> float:
        waves = np.exp(-2j * np.pi * np.outer(np.arange(1, 7), time) / trial)
        return float(np.sum(np.abs(waves @ half) ** 2))

    powers = np.array([power(float(trial)) for trial in candidates])
    best = int(np.argmax(powers))
    if 0 < best < len(powers) - 1:
        below, top, above = powers[best - 1 : best + 2]
        shift = 0.5 * (below - above) / (below - 2 * top + above)
        return float(candidates[best] + shift * (candidates[1] - candidates[0]))
    return float(candidates[best])


def _line(deviation: Real, period: float) -> tuple[float, float]:
    """Strongest line of the strobed deviation (Hz, 0 to half of 1/period), and the share of power at that half."""
    window = np.hanning(len(deviation) + 2)[1:-1, None]
    power = np.sum(np.abs(np.fft.rfft(deviation * window, axis=0)) ** 2, axis=1)
    frequencies = np.fft.rfftfreq(len(deviation), period)
    strongest = int(np.argmax(power[1:])) + 1
    return float(frequencies[strongest]), float(power[-3:].sum() / power.sum())
