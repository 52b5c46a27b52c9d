"""The comb of lines in the spectrum of a recording, from which the spindle's speed follows without a stated one."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from ..settings import THRESHOLDS
from .lines import independent_segments

_MEDIAN = 101  # lines whose median is the floor
_LINES = 40  # strongest lines that are compared
_STARTS = 10  # strongest lines of which one must be a multiple of the comb's spacing,
_MULTIPLE = 40  # up to this multiple
_FIRST = 3  # harmonics of the tooth passing of which one has a line
_HARMONICS = 4  # of the stated tooth passing, up to which a spacing is searched; and parts of the stated spindle


@dataclass(frozen=True)
class StrongLines:
    """Strongest lines of a recording, orders of the spindle included."""

    frequencies: Real  # (n_lines,): Hz, strongest first
    powers: Real  # (n_lines,): all channels together, each over its own largest line
    resolution: float  # Hz

    @classmethod
    def of(cls, samples: Real, sample_rate: float, seconds: float, distance: float = 0.0) -> "StrongLines":
        """Find the lines above the noise of samples (n_samples, n_channels), in segments of this duration (s).

        Of lines within a distance (Hz) of each other only the strongest is kept: others are skirts of one that varies.
        """
        length = min(len(samples), max(int(seconds * sample_rate), 64))
        frequencies, power = scipy.signal.welch(samples - samples.mean(axis=0), sample_rate, "hann", length, axis=0)
        averages = independent_segments(max(1, 2 * len(samples) // length - 1))
        total = np.sum(power / np.maximum(power.max(axis=0), 1e-300), axis=1)
        floor = scipy.ndimage.median_filter(total, _MEDIAN, mode="nearest")
        ratio = total / np.maximum(floor, 1e-300) * scipy.special.gammaincinv(averages, 0.5)  # times the averages
        p_values = len(total) * scipy.special.gammaincc(averages, ratio)
        peaks = np.flatnonzero((total[1:-1] > total[:-2]) & (total[1:-1] >= total[2:])) + 1
        resolution = float(frequencies[1])
        used = (p_values[peaks] < THRESHOLDS.order_p_value) & (peaks > 2)
        used &= frequencies[peaks] < THRESHOLDS.highest_line * sample_rate
        used &= total[peaks] > THRESHOLDS.negligible**2 * total.max()
        peaks = peaks[used][np.argsort(-total[peaks[used]])]
        chosen: list[int] = []
        least = max(3, round(distance / resolution))  # nearer than three lines are side lobes of the window
        for peak in peaks.tolist():
            if all(abs(peak - other) > least for other in chosen):
                chosen.append(peak)
        places = np.array(chosen[:_LINES], dtype=int)
        below, top, above = (np.sqrt(total[places + shift]) for shift in (-1, 0, 1))
        # interpolation in the main lobe of a Hann window (Grandke, IEEE Trans. Instrum. Meas. 32, 1983)
        shift = np.where(above > below, (2 * above - top) / (above + top), -(2 * below - top) / (below + top))
        return cls((places + np.clip(shift, -1.0, 1.0)) * resolution, total[places], resolution)

    @property
    def errors(self) -> Real:
        """Largest error of each frequency, Hz: that of the peak, and a speed that varies by 0.1 %."""
        return np.asarray(0.5 * self.resolution + THRESHOLDS.comb_error * self.frequencies)

    def without(self, spacing: float) -> "StrongLines":
        """Leave out the multiples of a spacing, Hz."""
        kept = ~self._multiples(spacing)[0]
        return StrongLines(self.frequencies[kept], self.powers[kept], self.resolution)

    def _multiples(self, spacing: Real | float) -> tuple[NDArray[np.bool_], Real]:
        """Return which lines are multiples of spacings (...), and of which order; (..., n_lines)."""
        spacing = np.asarray(spacing, dtype=float)[..., None]
        orders = np.round(self.frequencies / spacing)
        return (orders > 0) & (np.abs(self.frequencies - orders * spacing) < self.errors), orders

    def has_multiple(self, spacing: float, highest: int, used: NDArray[np.bool_]) -> bool:
        """Check whether one of the lines that are used is a multiple of a spacing (Hz), up to the highest."""
        multiples, orders = self._multiples(spacing)
        return bool(np.any(multiples & (orders <= highest) & used))

    def comb(self, spacing: Real) -> tuple[Real, NDArray[np.bool_], Real]:
        """Fit spacings (n,) to the lines that are their multiples.

        Returns
        -------
        spacing : (n,), Hz
            Weighted least squares of the multiples.
        multiples : (n, n_lines)
            Which lines are multiples.
        log_chance : (n,)
            Logarithm of the probability that as many lines of random frequencies are multiples (binomial).
        """
        for _ in range(3):
            multiples, orders = self._multiples(spacing)
            weights = multiples / self.errors**2
            fitted = np.sum(weights * orders * self.frequencies, axis=1)
            divisor = np.sum(weights * orders**2, axis=1)
            spacing = np.where(divisor > 0, fitted / np.maximum(divisor, 1e-300), spacing)
        multiples, _ = self._multiples(spacing)
        chance = np.minimum(1.0, 2 * self.errors / spacing[:, None]).mean(axis=1)
        return spacing, multiples, scipy.stats.binom.logsf(multiples.sum(axis=1) - 1, len(self.frequencies), chance)

    def chance_of_chatter(self, spindle: float, orders: NDArray[np.bool_]) -> float:
        """Return the logarithm of the probability that as many lines are orders of a spindle, or chatter in that cut.

        Chatter has lines at the distance of orders of the spindle (Hz) from its strongest line. A distance of two lines
        is known better than their frequencies.
        """
        others = np.flatnonzero(~orders)
        if not len(others):
            return 0.0
        strongest = others[np.argmax(self.powers[others])]
        distances = np.abs(self.frequencies - self.frequencies[strongest])
        errors = self.resolution + THRESHOLDS.comb_error * distances
        in_family = np.abs(distances - np.round(distances / spindle) * spindle) < errors
        explained = int(np.sum(orders | in_family)) - 1  # the strongest line is chosen
        chance = float(np.minimum(1.0, 2 * (self.errors + errors) / spindle).mean())
        return float(scipy.stats.binom.logsf(explained - 1, len(self.frequencies) - 1, chance))


@dataclass(frozen=True)
class FittedSpeed:
    """A spindle speed of which the lines are orders, where they are not those of the stated speed."""

    frequency: float  # Hz, of the spindle
    is_near: bool  # whether the stated speed is so near that the number of lines to a tooth is certain
    n_multiples: int
    n_lines: int

    def doubt(self, stated: float) -> str:
        """Say that a stated frequency of the spindle (Hz) is another."""
        rpm = 60 * self.frequency
        return (
            f"{self.n_multiples} of the {self.n_lines} strongest lines are orders of {rpm:.0f} rpm, few of the stated "
            f"{60 * stated:.0f} rpm: give --speed {rpm:.0f} if that is the speed, or check the number of teeth"
        )


def fitted_speed(lines: StrongLines, stated: float, teeth: int) -> FittedSpeed | None:
    """Return the speed that the lines fit far better than the stated one; None if there is none.

    The spacing of a comb is the frequency of the spindle, or of its teeth where these cut equally, or between: of the
    frequencies of the spindle that this leaves, that near the stated one is taken, or else that whose tooth passing
    has most of the power.

    Parameters
    ----------
    lines
        Strongest lines of the recording.
    stated : Hz
        Stated frequency of the spindle, or that which was found near it.
    teeth
        Number of teeth.
    """
    for _ in range(1 + len(THRESHOLDS.mains)):
        fitted, spacing = _better_comb(lines, stated, teeth)
        hum = lines.without(spacing) if fitted is not None and _is_mains(spacing) else lines
        # the hum is not most of what a sensor of the cut measures
        if fitted is None or fitted.is_near or hum.powers.sum() <= 0.5 * lines.powers.sum() or hum is lines:
            return fitted
        lines = hum
    return None


def _is_mains(spacing: float) -> bool:
    """Check whether a spacing (Hz) is the frequency of the power supply, or twice that of a rectifier."""
    multiples = [spacing / (number * mains) for mains in THRESHOLDS.mains for number in (1, 2)]
    return min(abs(ratio - 1) for ratio in multiples) < THRESHOLDS.mains_error


def _better_comb(lines: StrongLines, stated: float, teeth: int) -> tuple[FittedSpeed | None, float]:
    """Return the speed of the comb that fits far better than the stated one, if there is one, and its spacing, Hz."""
    if len(lines.frequencies) < 3:
        return None, math.nan
    starts = (lines.frequencies[:_STARTS, None] / np.arange(1, _MULTIPLE + 1)).ravel()
    starts = starts[(starts > stated / _HARMONICS) & (starts < _HARMONICS * teeth * stated)]
    if not len(starts):
        return None, math.nan
    spacings, multiples, chances = lines.comb(starts)
    best = int(np.argmin(chances))
    spacing, chance = float(spacings[best]), float(chances[best]) + math.log(len(starts))  # Bonferroni's correction
    at_stated, by_stated, stated_chances = lines.comb(np.array([stated, teeth * stated]))
    is_kept = np.abs(at_stated / stated / [1, teeth] - 1) < THRESHOLDS.reported_speed_error
    by_stated = by_stated[0] & is_kept[0]
    odds = math.log(THRESHOLDS.order_p_value)
    if chance > odds or chance > float(np.min(np.where(is_kept, stated_chances, 0.0))) + odds:
        return None, spacing
    beyond = lines.powers[multiples[best] & ~by_stated].sum() / lines.powers.sum()
    if beyond < THRESHOLDS.modulated**2 or _fits(spacing / stated, teeth):
        return None, spacing
    frequency, is_near = _spindle(lines, spacing, stated, teeth)
    if is_near and chance > lines.chance_of_chatter(stated, by_stated) + odds:
        return None, spacing
    # chatter at a rational part of the stated tooth passing is a comb, too, but one without its first harmonics
    if not is_near and not lines.has_multiple(teeth * frequency, _FIRST, ~by_stated):
        return None, spacing
    return FittedSpeed(frequency, is_near, int(multiples[best].sum()), len(lines.frequencies)), spacing


def _fits(ratio: float, teeth: int) -> bool:
    """Check whether lines of this spacing, over the stated spindle's frequency, are those of a cutter."""
    order = round(ratio)
    return order >= 1 and teeth % order == 0 and abs(ratio / order - 1) < THRESHOLDS.reported_speed_error


def _spindle(lines: StrongLines, spacing: float, stated: float, teeth: int) -> tuple[float, bool]:
    """Return the frequency (Hz) of a spindle whose teeth cause this comb, and whether it is near the stated one."""
    orders = [order for order in range(1, teeth + 1) if teeth % order == 0]
    nearest = min((order * spacing / teeth for order in orders), key=lambda speed: abs(math.log(speed / stated)))
    if abs(math.log(nearest / stated)) < THRESHOLDS.overridden:
        return nearest, True
    multiples, number = lines._multiples(spacing)
    total = lines.powers[multiples].sum()
    strong = [order for order in orders if lines.powers[multiples & (number % order == 0)].sum() >= 0.5 * total]
    return max(strong) * spacing / teeth, False
