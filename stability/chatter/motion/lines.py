"""Lines that stand out of a recording's own noise."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .beside_orders import stand_aside
from .orders import Revolutions

Real = NDArray[np.float64]

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
