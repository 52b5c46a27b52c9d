"""Check of a stated spindle speed against the lines of a recording."""

import math
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Real

from ..settings import THRESHOLDS
from .comb import FittedSpeed, StrongLines, fitted_speed
from .evidence import Evidence
from .lines import independent_segments

_PARTS = {3: "a third of", 2: "half"}  # of the stated speed
_MEDIAN = 101  # lines whose median is the floor
_SECONDS = 1.0  # duration of a segment where the speed is not known
_SEGMENTS = 6  # segments in the part in the cut, for the comb of its lines,
_LONGEST = 160  # of at most this many revolutions, over which the speed of a spindle is constant
_SKIRT = 8  # part of the spindle's frequency within which lines are skirts
_LOWEST = 5.0  # Hz, lowest tooth passing that is looked for


def other_speed(evidence: Evidence, samples: Real, teeth: int) -> FittedSpeed | None:
    """Return the speed of which the lines of the part in the cut are orders; None: the stated one will do."""
    rate, stop = evidence.sample_rate, evidence.judged.stop
    start = max(2 * evidence.judged.start - stop, 0)  # the part in the cut, of which the second half is judged
    begin, end = evidence.track.revolutions(np.array([start, stop]) / rate)
    spindle = float(end - begin) * rate / (stop - start)
    seconds = min((stop - start) / rate / _SEGMENTS, _LONGEST / spindle)
    lines = StrongLines.of(samples[start:stop], rate, seconds, spindle / _SKIRT)
    return fitted_speed(lines, spindle, teeth)


def slower_speed_warning(evidence: Evidence) -> str:
    """Warn where most of the motion is at orders of the spindle that equal teeth do not cause; else empty.

    Teeth that are as unequal as that are rare. A spindle at a part of the stated speed has such orders, too.
    """
    turn, teeth = evidence.late.mean_turn, evidence.late.teeth
    powers = np.sum(np.abs(np.fft.rfft(turn, axis=0)) ** 2, axis=1)
    orders = np.arange(len(powers))
    total = max(float(powers.sum()), 1e-300)
    parts = [part for part in range(1, teeth + 1) if teeth % part == 0]
    shares = {part: float(powers[orders % part == 0].sum()) / total for part in parts}
    if shares[teeth] >= 0.5:
        return ""
    part = max(part for part, share in shares.items() if share >= 0.5)
    slower = 60 * evidence.track.mean_frequency * part / teeth
    return (
        f"only {100 * math.sqrt(shares[teeth]):.0f} % of what repeats is at the tooth passing: teeth are unequal "
        f"(runout, a broken tooth), or the speed is {slower:.0f} rpm"
    )


def speed_doubt(
    evidence: Evidence, samples: Real, teeth: int, *, constant_force: bool = False, only_stated: bool = False
) -> str:
    """Return why the spindle cannot turn, or may not turn, at the stated speed; empty if nothing speaks against it.

    A spindle at a third of the stated speed has lines at thirds of the stated orders. At a multiple of it, or at an
    unrelated speed, there is no line at the stated tooth passing.

    Parameters
    ----------
    evidence
        Evidence gathered at the stated speed.
    samples : (n_samples, n_channels)
        The recording.
    teeth
        Number of teeth.
    constant_force
        Whether a stable cut has no line at the tooth passing.
    only_stated
        Whether nothing measured the speed; a harmonic far smaller than others then counts as missing.
    """
    spindle = evidence.track.mean_frequency
    stated = f"{60 * spindle:.0f} rpm"
    passing = f"the tooth passing of {teeth} teeth at {stated} ({teeth * spindle:.2f} Hz)"
    spectrum = _Averaged.of(samples[evidence.judged], evidence.sample_rate, THRESHOLDS.least_revolutions / spindle)
    sizes = {k: spectrum.size(k * teeth * spindle) for k in range(1, 7) if spectrum.has_peak(k * teeth * spindle)}
    # a foreign tone may be near a harmonic that is not there
    least = THRESHOLDS.first_harmonic[False] * max(sizes.values(), default=0.0) * only_stated
    harmonics = [k for k, size in sizes.items() if size > least]
    orders = any(spectrum.has_peak(order * spindle) for order in range(1, teeth))
    if min(harmonics, default=7) > 3 and not orders and not constant_force:
        return (
            f"there is no line at {passing}: check speed, number of teeth and sample rate, and that the tool is in the "
            "cut"
        )
    multiple = math.gcd(*harmonics) if len(harmonics) > 1 else 1
    if multiple > 1:
        return (
            f"of the harmonics of {passing} only multiples of {multiple} have a line: the speed is probably "
            f"{60 * multiple * spindle:.0f} rpm, or the number of teeth is wrong"
        )
    for divisor, words in _PARTS.items():
        if divisor == 2 and teeth % 2:
            continue  # period doubling has lines at half orders
        # unequal teeth have lines at orders, so that a line there says less than one between orders
        least = THRESHOLDS.first_harmonic[teeth % divisor == 0]
        slower = spectrum.size(teeth * spindle / divisor) > least * spectrum.size(teeth * spindle)
        if slower and _chance_of_parts(evidence, divisor) < THRESHOLDS.line_p_value:
            return (
                f"lines between the orders of the spindle lie at multiples of {words} its frequency: the speed is "
                f"probably {60 * spindle / divisor:.0f} rpm instead of {stated}"
            )
    return ""


def modulation_doubt(evidence: Evidence) -> str:
    """Return why side lines of chatter belong to half the stated speed; empty if nothing speaks against the stated one.

    Chatter of frequency f has lines at ``+-f + k f_tooth``. At twice the speed, every second of them lies half a tooth
    passing from the others, where an odd number of teeth has no order that unequal teeth could cause.
    """
    families = [family for family in evidence.families if family.share > THRESHOLDS.negligible]
    teeth = evidence.late.teeth
    orders = np.array([line.order for family in families for line in family.lines])
    if len(orders) < 2 or teeth % 2 == 0:
        return ""
    width = THRESHOLDS.line_error * evidence.spectrum.resolution / teeth
    apart = np.stack([orders[1:] - orders[0], orders[1:] + orders[0]]) / teeth
    halves = int((np.abs(apart - np.floor(apart) - 0.5) < width).any(axis=0).sum())
    if not scipy.stats.binom.sf(halves - 1, len(orders) - 1, min(1.0, 4 * width)) < THRESHOLDS.line_p_value:
        return ""
    rpm = 60 * evidence.track.mean_frequency
    return (
        f"side lines of the chatter lie half a tooth passing apart: the speed is probably {rpm / 2:.0f} rpm instead of "
        f"{rpm:.0f} rpm"
    )


def strongest_lines(samples: Real, sample_rate: float, count: int = 3) -> list[float]:
    """Return the frequencies (Hz) of the strongest lines of a recording (n_samples, n_channels), strongest first."""
    spectrum = _Averaged.of(samples, sample_rate, _SECONDS)
    power = np.sum(spectrum.power / np.maximum(spectrum.power.max(axis=0), 1e-300), axis=1)
    power[: round(_LOWEST / spectrum.resolution) + 1] = 0.0
    lines: list[float] = []
    while len(lines) < count and power.max() > 0:
        peak = int(np.argmax(power))
        if spectrum.has_peak(peak * spectrum.resolution):
            lines.append(peak * spectrum.resolution)
        power[max(peak - 3, 0) : peak + 4] = 0.0
    return lines


def _chance_of_parts(evidence: Evidence, divisor: int) -> float:
    """Compute the probability that as many lines between orders lie at multiples of a part of the spindle's frequency.

    Lines at other frequencies than these have any order with equal probability.
    """
    families = [family for family in evidence.families if family.share > THRESHOLDS.negligible]
    if sum(family.share**2 for family in families) < THRESHOLDS.modulated**2:
        return 1.0
    lines = [line for family in families for line in family.lines]
    orders = divisor * np.array([line.order for line in lines])
    width = divisor * THRESHOLDS.line_error * evidence.spectrum.resolution
    hits = int(np.sum(np.abs(orders - np.round(orders)) < width))
    return float(scipy.stats.binom.sf(hits - 1, len(lines), min(1.0, 2 * width * (divisor - 1) / divisor)))


@dataclass(frozen=True)
class _Averaged:
    """Averaged spectrum of a recording, orders included."""

    power: Real  # (n_lines, n_channels)
    resolution: float  # Hz
    averages: float  # number of independent segments

    @classmethod
    def of(cls, samples: Real, sample_rate: float, seconds: float) -> "_Averaged":
        """Average segments of this duration."""
        length = min(len(samples), max(int(seconds * sample_rate), 64))
        frequencies, power = scipy.signal.welch(samples - samples.mean(axis=0), sample_rate, "hann", length, axis=0)
        return cls(power, float(frequencies[1]), independent_segments(max(1, 2 * len(samples) // length - 1)))

    def _near(self, frequency: float) -> tuple[Real, Real]:
        """Return the lines within the error of the speed, and those whose median is the floor."""
        place = frequency / self.resolution
        reach = max(2, round(THRESHOLDS.speed_drift / 2 * place))
        around = self.power[max(round(place) - _MEDIAN // 2, 1) : round(place) + _MEDIAN // 2 + 1]
        return self.power[max(round(place) - reach, 1) : round(place) + reach + 1], around

    def size(self, frequency: float) -> float:
        """Return the largest amplitude near a frequency, all channels together, each over its own largest."""
        near, _ = self._near(frequency)
        return math.sqrt(float(np.max(np.sum(near / self.power.max(axis=0), axis=1)))) if len(near) else 0.0

    def has_peak(self, frequency: float) -> bool:
        """Check whether a line above the floor of any channel is near a frequency; it must be larger than its sides."""
        near, around = self._near(frequency)
        if len(near) < 3 or frequency > 0.9 * self.resolution * len(self.power):
            return False
        peak = np.argmax(near, axis=0)
        median = scipy.special.gammaincinv(self.averages, 0.5)  # over the mean, times the averages
        ratio = near.max(axis=0) / np.maximum(np.median(around, axis=0), 1e-300) * median
        p_values = near.size * scipy.special.gammaincc(self.averages, ratio)
        return bool(np.any((peak > 0) & (peak < len(near) - 1) & (p_values < THRESHOLDS.order_p_value)))
