"""Spectral lines above the noise of a recording, and the families they form."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Real

from .orders import Revolutions

ONE_SIDED = 10.0
"""Power of a line over that at the same distance beyond the order, from which it is none of the order's own."""
OF_THE_ORDER = 0.1
"""Its power over the order's, from which a slow change of the order does not explain it."""


def stand_aside(power: Real, count: int, order_power: Real) -> NDArray[np.bool_]:
    """Say which lines of a spectrum stand beside an order and are none of its own.

    An order whose size or angle varies slowly has two lines of equal size beside it. Chatter whose frequency comes
    close to an order has one.

    Parameters
    ----------
    power : (n_lines,)
        Mean square a line of resolution, all channels together, orders taken away.
    count
        Lines of resolution from one order to the next.
    order_power : (n_orders,)
        Mean square of each order from 0 on, all channels together.

    Returns
    -------
    (n_lines,)
        True for such lines, away from all orders too.

    Examples
    --------
    >>> power = np.full(31, 1e-6)
    >>> power[[9, 11, 18]] = 0.2, 0.2, 0.3  # two lines beside the first order, one beside the second
    >>> np.flatnonzero(stand_aside(power, 10, np.ones(3)))
    array([18])
    """
    lines = np.arange(len(power))
    nearest = np.round(lines / count).astype(int)
    beyond = 2 * nearest * count - lines
    known = (beyond >= 0) & (beyond < len(power)) & (nearest < len(order_power)) & (beyond != lines)
    result = np.zeros(len(power), dtype=bool)
    mirrored, order = power[beyond[known]], order_power[nearest[known]]
    result[known] = (power[known] > ONE_SIDED * mirrored) & (power[known] > OF_THE_ORDER * order)
    return result


GUARD = 2.5
"""Lines of resolution on either side of each order in which only lines that stand aside of it are looked for."""
MOST_LINES = 80
"""Strongest lines that are kept."""
_FLOOR_BINS = 60  # at least, over which the floor's median is taken


@dataclass(frozen=True)
class Line:
    """A line of the spectrum that is not an order of the spindle.

    Parameters
    ----------
    order
        Frequency of the line over the spindle's.
    frequency : Hz
        Frequency of the line.
    amplitude : (n_channels,)
        Root mean square of the line in each channel, in the unit of the samples.
    p_value
        Probability that noise with the recording's own local floor has a line as strong anywhere in the spectrum.
    sharpness
        Power within two lines of resolution over that within ten: 1 for a tone or a limit cycle, a quarter for noise.
    """

    order: float
    frequency: float
    amplitude: Real
    p_value: float
    sharpness: float


@dataclass(frozen=True)
class Spectrum:
    """Power of what does not repeat, its floor and the lines that stand out.

    Parameters
    ----------
    orders : (n_lines,)
        Frequency over the spindle's.
    power, floor : (n_lines, n_channels)
        Mean square a line of resolution, and what noise has there.
    searched : (n_lines,)
        Whether lines are looked for there.
    resolution
        Orders between two lines of resolution.
    """

    orders: Real
    power: Real
    floor: Real
    searched: NDArray[np.bool_]
    resolution: float

    @property
    def p_values(self) -> Real:
        """Family-wise p-value of each line, (n_lines,): ``n exp(-power / floor)``, n the number of lines searched.

        Under noise whose spectrum is smooth a periodogram is exponentially distributed about its floor (Percival &
        Walden, Spectral Analysis for Physical Applications, section 6.6); Bonferroni's correction for all lines and
        channels.
        """
        number = max(1, int(self.searched.sum())) * self.power.shape[1]
        ratio = (self.power / self.floor).max(axis=1)
        values = np.minimum(1.0, number * np.exp(-np.minimum(ratio, 700.0)))
        return np.where(self.searched, values, 1.0)


def spectrum_of(revolutions: Revolutions, forbidden: tuple[float, ...] = ()) -> Spectrum:
    """Spectrum of the residual over orders, with its local floor.

    Parameters
    ----------
    revolutions
        Part of the recording that is judged.
    forbidden
        Shares of an order (0 to 1) at which other known lines repeat, and which are left out beside the orders.
    """
    rest = revolutions.residual
    n = len(rest)
    window = np.hanning(n + 2)[1:-1, None]
    scale = 2 / (window.sum() ** 2) / 1.5  # the sum of power over a line is its mean square
    power = scale * np.abs(np.fft.rfft(rest * window, axis=0)) ** 2
    orders = np.arange(len(power)) / revolutions.count
    resolution = 1 / revolutions.count
    order_power = 2 * np.sum(
        np.abs(np.fft.rfft(revolutions.mean_turn, axis=0) / revolutions.samples.shape[1]) ** 2, axis=1
    )
    searched = np.abs(orders - np.round(orders)) > GUARD * resolution
    searched |= stand_aside(power.sum(axis=1), revolutions.count, order_power)
    searched &= orders < 0.42 * revolutions.samples.shape[1]
    for share in forbidden:
        for sign in (1, -1):
            away = orders - sign * share
            searched &= np.abs(away - np.round(away)) > GUARD * resolution
    width = max(_FLOOR_BINS, revolutions.count)
    floor = _local_median(power, searched, width) / np.log(2) + 1e-14 * revolutions.size**2
    return Spectrum(orders, power, floor, searched, resolution)


def _local_median(power: Real, used: NDArray[np.bool_], width: int) -> Real:
    """Median of the lines used in overlapping windows, straight between their middles, (n_lines, n_channels)."""
    middles, medians = [], []
    for start in range(0, max(len(power) - width // 2, 1), max(width // 2, 1)):
        chosen = power[start : start + width][used[start : start + width]]
        if len(chosen) >= 8:
            middles.append(start + width / 2)
            medians.append(np.median(chosen, axis=0))
    if not middles:
        return np.full_like(power, np.inf)
    places = np.arange(len(power))
    return np.column_stack([np.interp(places, middles, column) for column in np.array(medians).T])


def lines_of(spectrum: Spectrum, frequency: float, level: float) -> tuple[Line, ...]:
    """The lines with a p-value below ``level``, strongest first; ``frequency`` is the spindle's, Hz."""
    values = spectrum.p_values
    ratio = (spectrum.power / spectrum.floor).max(axis=1)
    total = spectrum.power.sum(axis=1)
    left = np.concatenate([[-np.inf], ratio[:-1]])
    right = np.concatenate([ratio[1:], [-np.inf]])
    peaks = np.flatnonzero((values < level) & (ratio >= left) & (ratio > right))
    peaks = peaks[np.argsort(-total[peaks])]
    found: list[Line] = []
    taken: list[int] = []
    for peak in peaks:
        if all(abs(int(peak) - other) > 3 for other in taken):
            taken.append(int(peak))
            found.append(_line(spectrum, int(peak), float(values[peak]), frequency))
        if len(found) == MOST_LINES:
            break
    return tuple(found)


def _line(spectrum: Spectrum, peak: int, p_value: float, frequency: float) -> Line:
    total = spectrum.power.sum(axis=1)
    below, top, above = np.sqrt(total[peak - 1 : peak + 2])
    # of a Hann window's main lobe (Grandke, IEEE Trans. Instrum. Meas. 32, 1983)
    shift = (2 * above - top) / (above + top) if above > below else -(2 * below - top) / (below + top)
    order = (peak + float(np.clip(shift, -1.0, 1.0))) * spectrum.resolution
    amplitude = np.sqrt(spectrum.power[max(peak - 2, 0) : peak + 3].sum(axis=0))
    beside = total[max(peak - 10, 0) : peak + 11].sum()
    return Line(order, order * frequency, amplitude, p_value, float((amplitude**2).sum() / beside))


TOLERANCE = 1.2
"""Lines of resolution by which lines of one family may differ."""
SHARP = 0.85
"""Sharpness from which a line is a periodic motion rather than noise through a lightly damped mode."""
_SHARP_SIDES = 2


@dataclass(frozen=True)
class Family:
    """Lines at ``+-f + k f_tooth``: one periodic disturbance and what the teeth make of it.

    Parameters
    ----------
    lines
        Lines of the family, strongest first.
    share
        Root mean square of the lines over that of the motion, in the channel where it is largest.
    place
        Distance from the nearest multiple of the tooth passing, in orders of the spindle, 0 to half the teeth.
    """

    lines: tuple[Line, ...]
    share: float
    place: float

    @property
    def sharp(self) -> bool:
        """Whether the strongest line and two or more side lines are as narrow as the record is long."""
        sharp_sides = sum(line.sharpness > SHARP for line in self.lines[1:])
        return self.lines[0].sharpness > SHARP and sharp_sides >= _SHARP_SIDES

    @property
    def p_value(self) -> float:
        """Probability that noise alone has a line as strong as the most significant one."""
        return min(line.p_value for line in self.lines)


def folded(order: float, teeth: int) -> float:
    """Distance (orders) from the nearest multiple of the number of teeth."""
    return abs((order + teeth / 2) % teeth - teeth / 2)


def families_of(lines: tuple[Line, ...], teeth: int, resolution: float, size: Real) -> tuple[Family, ...]:
    """Gather lines by their place between two multiples of the tooth passing; families with most power come first.

    Parameters
    ----------
    lines
        Lines of the spectrum, strongest first.
    teeth
        Number of teeth.
    resolution
        Distance between two lines of the spectrum, in orders of the spindle.
    size : (n_channels,)
        Root mean square of the motion in each channel.
    """
    left = list(lines)
    found = []
    while left:
        place = folded(left[0].order, teeth)
        own = [line for line in left if abs(folded(line.order, teeth) - place) < TOLERANCE * resolution]
        left = [line for line in left if line not in own]
        power = np.sum([line.amplitude**2 for line in own], axis=0)
        found.append(Family(tuple(own), float(np.max(np.sqrt(power) / size)), place))
    return tuple(sorted(found, key=lambda family: -family.share))


def largest_motion(lines: tuple[Line, ...], derivative: tuple[int, ...], natural: tuple[float, ...]) -> Line:
    """The line of a family at which the tool moves most, or, with natural frequencies, the one nearest to a mode.

    Chatter vibrates close to a mode of the structure (Altintas, Manufacturing Automation, 2nd ed., section 3.3); its
    other lines are what the teeth make of it. Lines weaker than a tenth of the largest motion are not taken.

    Parameters
    ----------
    lines
        Lines of one family.
    derivative : (n_channels,)
        2 for acceleration, 1 for velocity, 0 for displacement.
    natural
        Natural frequencies of the structure, Hz; empty: not known.
    """

    def motion(line: Line) -> float:
        sizes = [a / line.frequency**power for a, power in zip(line.amplitude, derivative, strict=True)]
        return math.sqrt(sum(size**2 for size in sizes))

    largest = max(motion(line) for line in lines)
    if not natural:
        return max(lines, key=motion)
    strong = [line for line in lines if motion(line) > 0.1 * largest]
    return min(strong, key=lambda line: min(abs(math.log(line.frequency / mode)) for mode in natural))
