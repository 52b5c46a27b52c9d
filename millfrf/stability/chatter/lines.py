"""Spectral lines above the noise of a recording, and the families they form."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from ..settings import THRESHOLDS
from .spindle import Revolutions


def one_sided_lines(power: Real, count: int, order_power: Real) -> NDArray[np.bool_]:
    """Find lines close to an order of the spindle that are not modulations of it, (n_lines,).

    An order whose size or angle varies slowly has two lines of equal size next to it. Chatter whose frequency is close
    to an order causes a single line next to it. Lines far from all orders are found, too.

    Parameters
    ----------
    power : (n_lines,)
        Mean square per line of resolution, all channels together, orders subtracted.
    order_power : (n_orders,)
        Mean square of each order from 0 on, all channels together.

    Examples
    --------
    >>> power = np.full(31, 1e-6)
    >>> power[[9, 11, 18]] = 0.2, 0.2, 0.3  # two lines next to the first order, one next to the second
    >>> np.flatnonzero(one_sided_lines(power, 10, np.ones(3)))
    array([18])
    """
    lines = np.arange(len(power))
    nearest = np.round(lines / count).astype(int)
    mirror = 2 * nearest * count - lines
    known = (mirror >= 0) & (mirror < len(power)) & (nearest < len(order_power)) & (mirror != lines)
    result = np.zeros(len(power), dtype=bool)
    mirrored, order = power[mirror[known]], order_power[nearest[known]]
    result[known] = (power[known] > THRESHOLDS.one_sided * mirrored) & (power[known] > THRESHOLDS.of_the_order * order)
    return result


@dataclass(frozen=True)
class Line:
    """A line of the spectrum that is not an order of the spindle."""

    order: float  # frequency over the spindle's
    frequency: float  # Hz
    amplitude: Real  # (n_channels,): root mean square, in the unit of the samples
    p_value: float  # probability that noise with the local floor has a line as strong anywhere in the spectrum
    # power above the floor within 2 lines of resolution over that within 10 or a quarter of an order, in segments: 1
    # for a limit cycle, 1/4 to 1/2 for noise
    sharpness: float
    fluctuation: float  # standard deviation of the power in the segments over its mean; NaN where they are too few


@dataclass(frozen=True)
class Spectrum:
    """Power of the motion that does not repeat, averaged over overlapping segments, and its noise floor."""

    orders: Real  # (n_lines,): frequency over the spindle's
    power: Real  # (n_lines, n_channels): mean square per line of resolution
    floor: Real  # (n_lines, n_channels): mean square of noise per line of resolution
    searched: NDArray[np.bool_]  # (n_lines,): whether significant lines are searched there
    per_order: int  # lines from one order of the spindle to the next: revolutions in a segment
    averages: float  # number of independent segments that have the same variance as the average
    segments: Real  # (n_segments, n_lines): power of each segment, all channels together

    @property
    def resolution(self) -> float:
        """Distance of two lines, in orders."""
        return 1 / self.per_order

    @property
    def p_values(self) -> Real:
        """Compute the family-wise p-value of each line, (n_lines,).

        Under noise whose spectrum is smooth, the average of m periodograms over its floor has a gamma distribution
        with shape m and mean 1 (Percival & Walden, Spectral Analysis for Physical Applications, section 8.8; m = 1:
        exponential); Bonferroni's correction for all lines and channels.
        """
        ratio = (self.power / self.floor).max(axis=1)
        values = np.minimum(1.0, self._tested * scipy.special.gammaincc(self.averages, self.averages * ratio))
        return np.where(self.searched, values, 1.0)

    def significant(self, p_value: float) -> float:
        """Return the power over the floor from which a line has at most this family-wise p-value."""
        return float(scipy.special.gammainccinv(self.averages, p_value / self._tested) / self.averages)

    @property
    def _tested(self) -> int:
        """Number of lines that are searched in all channels."""
        return int(max(1, self.searched.sum()) * self.power.shape[1])


def spectrum_of(revolutions: Revolutions) -> Spectrum:
    """Compute the spectrum of the residual over orders of the spindle, with its local noise floor."""
    length = revolutions.steady or revolutions.count
    powers = _segments(revolutions, length)
    power, n_segments = powers.mean(axis=0), len(powers)
    averages = independent_segments(n_segments)
    orders = np.arange(len(power)) / length
    order_power = 2 * np.sum(
        np.abs(np.fft.rfft(revolutions.mean_turn, axis=0) / revolutions.samples.shape[1]) ** 2, axis=1
    )
    distance = np.abs(orders - np.round(orders)) * length
    if _skirts(power, revolutions, length) < THRESHOLDS.negligible:
        searched = (distance > THRESHOLDS.order_guard) | one_sided_lines(power.sum(axis=1), length, order_power)
    else:  # even the shortest segments hold orders that vary
        searched = distance > 2 * THRESHOLDS.order_guard
    searched &= orders < revolutions.highest_order
    floor = _local_median(power, searched, max(60, length))
    median = scipy.special.gammaincinv(averages, 0.5) / averages  # over the mean
    floor = floor / median + 1e-14 * revolutions.size**2  # above zero
    return Spectrum(orders, power, floor, searched, length, averages, powers.sum(axis=2))


def independent_segments(count: int) -> float:
    """Return how many independent segments have the variance of the mean of segments that overlap by half.

    The powers of neighbours under a Hann window correlate by 1/36 (Welch, IEEE Trans. Audio Electroacoust. 15, 1967).
    """
    return count / (1 + 2 * (count - 1) / count / 36)


def _power(residual: Real) -> Real:
    """Compute the mean square per line of resolution of one segment, (n_lines, n_channels)."""
    window = np.hanning(len(residual) + 2)[1:-1, None]
    scale = 2 / (window.sum() ** 2) / 1.5  # the sum of power over a line is its mean square
    return np.asarray(scale * np.abs(np.fft.rfft(residual * window, axis=0)) ** 2)


def steady_length(revolutions: Revolutions) -> int:
    """Find the largest number of revolutions over which the orders of the spindle change at most linearly.

    An order whose size or angle varies has a skirt on both sides. The recording is halved until the power that lies
    symmetrically next to all orders, outside the lines that hold the orders themselves, is that of a negligible
    motion.
    """
    length = revolutions.count
    while length // 2 >= THRESHOLDS.shortest_segment:
        power = _segments(revolutions, length).mean(axis=0)
        if _skirts(power, revolutions, length) < THRESHOLDS.negligible:
            break
        length //= 2
    return length


def _segments(revolutions: Revolutions, length: int) -> Real:
    """Compute the power of segments that overlap by half, (n_segments, n_lines, n_channels)."""
    starts = range(0, revolutions.count - length + 1, max(length // 2, 1))
    return np.array([_power(revolutions.part(start, start + length).residual) for start in starts])


def _skirts(power: Real, revolutions: Revolutions, length: int) -> float:
    """Compute the size of what lies symmetrically next to the orders, over the size of the motion, in one channel."""
    return float(np.sqrt(np.max(skirt_power(power, revolutions, length) / revolutions.size**2)))


def skirt_power(power: Real, revolutions: Revolutions, length: int) -> Real:
    """Compute the mean square of what lies symmetrically next to the orders, (n_channels,).

    ``power`` (n_lines, n_channels) is that of segments of this many revolutions.
    """
    places = length * np.arange(1, int(revolutions.highest_order))[:, None]
    distances = np.arange(int(THRESHOLDS.order_guard) + 1, max(length // 6, int(THRESHOLDS.order_guard) + 2))
    both = np.minimum(power[places + distances], power[places - distances])  # (n_orders, n_distances, n_channels)
    between = np.arange(length // 3, 2 * length // 3 + 1)
    middle = np.median(power[places + between], axis=1, keepdims=True)
    return np.asarray(2 * np.maximum(both - 2 * middle, 0.0).sum(axis=(0, 1)))


def _local_median(power: Real, used: NDArray[np.bool_], width: int) -> Real:
    """Compute medians of the used lines in overlapping windows, interpolated linearly, (n_lines, n_channels)."""
    middles, medians = [], []
    for start in range(0, max(len(power) - width // 2, 1), max(width // 2, 1)):
        chosen = power[start : start + width][used[start : start + width]]
        if len(chosen) >= 8:
            middles.append(start + width / 2)
            medians.append(np.median(chosen, axis=0))
    if not middles:
        return np.full_like(power, np.inf)
    lines = np.arange(len(power))
    return np.column_stack([np.interp(lines, middles, column) for column in np.array(medians).T])


def lines_of(spectrum: Spectrum, frequency: float) -> tuple[Line, ...]:
    """Find the significant lines, strongest first; ``frequency`` is the frequency of the spindle, Hz."""
    values = spectrum.p_values
    ratio = (spectrum.power / spectrum.floor).max(axis=1)
    total = spectrum.power.sum(axis=1)
    left = np.concatenate([[-np.inf], ratio[:-1]])
    right = np.concatenate([ratio[1:], [-np.inf]])
    peaks = np.flatnonzero((values < THRESHOLDS.line_p_value) & (ratio >= left) & (ratio > right))
    chosen: list[int] = []
    for peak in peaks[np.argsort(-total[peaks])].tolist():
        # within three lines of a stronger peak only its window's side lobes are found
        if all(abs(peak - other) > 3 for other in chosen):
            chosen.append(peak)
        if len(chosen) == THRESHOLDS.most_lines:
            break
    return tuple(_line(spectrum, peak, float(values[peak]), frequency) for peak in chosen)


def _line(spectrum: Spectrum, peak: int, p_value: float, frequency: float) -> Line:
    total = spectrum.power.sum(axis=1)
    below, top, above = np.sqrt(total[peak - 1 : peak + 2])
    # interpolation in the main lobe of a Hann window (Grandke, IEEE Trans. Instrum. Meas. 32, 1983)
    shift = (2 * above - top) / (above + top) if above > below else -(2 * below - top) / (below + top)
    order = (peak + float(np.clip(shift, -1.0, 1.0))) * spectrum.resolution
    amplitude = np.sqrt(spectrum.power[max(peak - 2, 0) : peak + 3].sum(axis=0))
    return Line(order, order * frequency, amplitude, p_value, *_shape(spectrum, peak))


def _shape(spectrum: Spectrum, peak: int) -> tuple[float, float]:
    """Compute sharpness and fluctuation of a line; its frequency may differ from segment to segment."""
    reach = max(4, min(10, spectrum.per_order // 4))
    floor = float(spectrum.floor[peak].sum())
    first = max(peak - 2 * reach, 0)
    near = spectrum.segments[:, first : peak + 2 * reach + 1]
    low = max(peak - first - reach // 2, 0)
    places = low + np.argmax(near[:, low : peak - first + reach // 2 + 1], axis=1)
    pairs = list(zip(near, places, strict=True))
    narrow = np.array([_sum_above(row, place, 2, floor) for row, place in pairs])
    wide = np.array([_sum_above(row, place, reach, floor) for row, place in pairs])
    fluctuation = narrow.std() / narrow.mean() if len(narrow) >= THRESHOLDS.least_segments else math.nan
    return float(min(1.0, narrow.sum() / max(wide.sum(), 1e-300))), float(fluctuation)


def _sum_above(power: Real, place: int, reach: int, floor: float) -> float:
    """Sum the power of lines within a reach, minus that of the floor."""
    part = power[max(place - reach, 0) : place + reach + 1]
    return max(float(part.sum()) - len(part) * floor, 1e-300)


@dataclass(frozen=True)
class Family:
    """Lines at ``+-f + k f_tooth``: one periodic disturbance and its modulation by the teeth."""

    lines: tuple[Line, ...]  # strongest first
    share: float  # root mean square of the lines over that of the motion, in the channel with the largest ratio
    place: float  # distance from the nearest multiple of the tooth passing in orders, 0 to half the teeth

    @property
    def sharp(self) -> bool:
        """Check whether the strongest line and two or more side lines are as narrow as the recording allows."""
        sharp_sides = sum(line.sharpness > THRESHOLDS.sharp for line in self.lines[1:])
        return self.lines[0].sharpness > THRESHOLDS.sharp and sharp_sides >= THRESHOLDS.sharp_sides

    @property
    def fluctuation(self) -> float:
        """Return the fluctuation of the strongest line; NaN where there are too few segments."""
        return self.lines[0].fluctuation

    @property
    def p_value(self) -> float:
        """Return the probability that noise alone has a line as strong as the family's most significant line."""
        return min(line.p_value for line in self.lines)


def folded(order: float, teeth: int) -> float:
    """Compute the distance (orders) from the nearest multiple of the number of teeth."""
    return abs((order + teeth / 2) % teeth - teeth / 2)


def families_of(lines: tuple[Line, ...], teeth: int, resolution: float, weights: Real) -> tuple[Family, ...]:
    """Group lines by their place between two multiples of the tooth passing; families with most power come first.

    ``lines`` are sorted, strongest first; ``resolution`` is their distance in orders of the spindle, and ``weights``
    (n_quantities, n_channels) as in :func:`share_of`.
    """
    remaining = list(lines)
    families = []
    while remaining:
        place = folded(remaining[0].order, teeth)
        width = THRESHOLDS.same_family * resolution
        members = [line for line in remaining if abs(folded(line.order, teeth) - place) < width]
        remaining = [line for line in remaining if line not in members]
        power = np.sum([line.amplitude**2 for line in members], axis=0)
        families.append(Family(tuple(members), share_of(power, weights), place))
    return tuple(sorted(families, key=lambda family: -family.share))


def share_of(power: Real, weights: Real) -> float:
    """Return the size of a part of the motion over the size of all motion, for the quantity in which it is largest.

    Parameters
    ----------
    power : (n_channels,)
        Mean square of the part in each channel.
    weights : (n_quantities, n_channels)
        Factor of each channel's power in the sum of one quantity, such that the power of all motion sums to 1. A motion
        in one direction is thus compared with the motion in all directions.
    """
    return float(np.sqrt(np.max(weights @ power)))


def other_line(lines: tuple[Line, ...], chosen: Line) -> float:
    """Return the frequency of another line of a family that may be the chatter's own, Hz; NaN if there is none.

    A sensor amplifies its lines differently, and says acceleration where the tool's displacement decides. Another line
    may be the chatter's own if it has more than half the amplitude of the chosen one, as measured or over the frequency
    squared.
    """
    sizes = [float(np.linalg.norm(line.amplitude)) for line in lines]
    powers = (0, 2)
    own = [float(np.linalg.norm(chosen.amplitude)) / chosen.frequency**power for power in powers]
    others = [
        (size, line.frequency)
        for size, line in zip(sizes, lines, strict=True)
        if line is not chosen
        and any(size / line.frequency**power > 0.5 * at for power, at in zip(powers, own, strict=True))
    ]
    return max(others)[1] if others else math.nan


def largest_motion(lines: tuple[Line, ...], derivative: tuple[int, ...], natural: tuple[float, ...]) -> Line:
    """Return the line of a family with the largest motion; with natural frequencies (Hz), the line nearest to a mode.

    Chatter vibrates close to a mode of the structure (Altintas, Manufacturing Automation, 2nd ed., section 3.3); its
    other lines are modulations by the teeth. Lines with less than a tenth of the largest motion are not considered.
    ``derivative`` is 2 for acceleration, 1 for velocity, 0 for displacement, for each channel; empty: 0.
    """

    def motion(line: Line) -> float:
        powers = derivative or (0,) * len(line.amplitude)
        sizes = [a / line.frequency**power for a, power in zip(line.amplitude, powers, strict=True)]
        return math.sqrt(sum(size**2 for size in sizes))

    if not natural:
        return max(lines, key=motion)
    largest = max(motion(line) for line in lines)
    strong = [line for line in lines if motion(line) > 0.1 * largest]
    return min(strong, key=lambda line: min(abs(math.log(line.frequency / mode)) for mode in natural))
