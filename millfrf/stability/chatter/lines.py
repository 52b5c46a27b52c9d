"""Spectral lines above the noise of a recording, and the families they form."""

import math
from dataclasses import dataclass

import numpy as np
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
    sharpness: float  # power within 2 lines of resolution over that within 10: 1 for a limit cycle, 1/4 for noise


@dataclass(frozen=True)
class Spectrum:
    """Power of the motion that does not repeat, and its noise floor."""

    orders: Real  # (n_lines,): frequency over the spindle's
    power: Real  # (n_lines, n_channels): mean square per line of resolution
    floor: Real  # (n_lines, n_channels): mean square of noise per line of resolution
    searched: NDArray[np.bool_]  # (n_lines,): whether significant lines are searched there
    resolution: float  # in orders

    @property
    def p_values(self) -> Real:
        """Compute the family-wise p-value of each line, (n_lines,): ``n exp(-power / floor)`` for n searched lines.

        Under noise whose spectrum is smooth a periodogram is exponentially distributed about its floor (Percival &
        Walden, Spectral Analysis for Physical Applications, section 6.6); Bonferroni's correction for all lines and
        channels.
        """
        number = max(1, int(self.searched.sum())) * self.power.shape[1]
        ratio = (self.power / self.floor).max(axis=1)
        values = np.minimum(1.0, number * np.exp(-np.minimum(ratio, 700.0)))
        return np.where(self.searched, values, 1.0)


def spectrum_of(revolutions: Revolutions) -> Spectrum:
    """Compute the spectrum of the residual over orders of the spindle, with its local noise floor."""
    residual = revolutions.residual
    n = len(residual)
    window = np.hanning(n + 2)[1:-1, None]
    scale = 2 / (window.sum() ** 2) / 1.5  # the sum of power over a line is its mean square
    power = scale * np.abs(np.fft.rfft(residual * window, axis=0)) ** 2
    orders = np.arange(len(power)) / revolutions.count
    resolution = 1 / revolutions.count
    order_power = 2 * np.sum(
        np.abs(np.fft.rfft(revolutions.mean_turn, axis=0) / revolutions.samples.shape[1]) ** 2, axis=1
    )
    searched = np.abs(orders - np.round(orders)) > THRESHOLDS.order_guard * resolution
    searched |= one_sided_lines(power.sum(axis=1), revolutions.count, order_power)
    searched &= orders < 0.42 * revolutions.samples.shape[1]  # above, the resampling's filter attenuates
    floor = _local_median(power, searched, max(60, revolutions.count))
    # the median of exponentially distributed power is ln 2 of its mean; the small term keeps the floor above zero
    floor = floor / np.log(2) + 1e-14 * revolutions.size**2
    return Spectrum(orders, power, floor, searched, resolution)


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
    around = total[max(peak - 10, 0) : peak + 11].sum()
    return Line(order, order * frequency, amplitude, p_value, float((amplitude**2).sum() / around))


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
    def p_value(self) -> float:
        """Return the probability that noise alone has a line as strong as the family's most significant line."""
        return min(line.p_value for line in self.lines)


def folded(order: float, teeth: int) -> float:
    """Compute the distance (orders) from the nearest multiple of the number of teeth."""
    return abs((order + teeth / 2) % teeth - teeth / 2)


def families_of(lines: tuple[Line, ...], teeth: int, resolution: float, size: Real) -> tuple[Family, ...]:
    """Group lines by their place between two multiples of the tooth passing; families with most power come first.

    ``lines`` are sorted, strongest first; ``resolution`` is their distance in orders of the spindle, and ``size`` the
    root mean square of the motion in each channel.
    """
    remaining = list(lines)
    families = []
    while remaining:
        place = folded(remaining[0].order, teeth)
        width = THRESHOLDS.same_family * resolution
        members = [line for line in remaining if abs(folded(line.order, teeth) - place) < width]
        remaining = [line for line in remaining if line not in members]
        power = np.sum([line.amplitude**2 for line in members], axis=0)
        families.append(Family(tuple(members), float(np.max(np.sqrt(power) / size)), place))
    return tuple(sorted(families, key=lambda family: -family.share))


def largest_motion(lines: tuple[Line, ...], derivative: tuple[int, ...], natural: tuple[float, ...]) -> Line:
    """Return the line of a family with the largest motion; with natural frequencies (Hz), the line nearest to a mode.

    Chatter vibrates close to a mode of the structure (Altintas, Manufacturing Automation, 2nd ed., section 3.3); its
    other lines are modulations by the teeth. Lines with less than a tenth of the largest motion are not considered.
    ``derivative`` is 2 for acceleration, 1 for velocity, 0 for displacement, for each channel.
    """

    def motion(line: Line) -> float:
        sizes = [a / line.frequency**power for a, power in zip(line.amplitude, derivative, strict=True)]
        return math.sqrt(sum(size**2 for size in sizes))

    if not natural:
        return max(lines, key=motion)
    largest = max(motion(line) for line in lines)
    strong = [line for line in lines if motion(line) > 0.1 * largest]
    return min(strong, key=lambda line: min(abs(math.log(line.frequency / mode)) for mode in natural))
