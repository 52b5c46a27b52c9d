"""Which lines of periodic forces were excited, and which even or odd harmonics were left out to show distortion."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from .cut_periods import SteadyPeriods

Real = NDArray[np.float64]

FAR_BELOW, BELOW = 1e-3, 1e-2
"""Power of a line that was not excited: over the largest of all, and over the largest of the neighbours."""

NEIGHBOURS = 10
"""Lines to either side that a line is compared with."""

MAINS = (50.0, 60.0)
"""Hz; their multiples are no lines that show distortion, because hum stays in step with many a period."""

INSIDE_ODD, INSIDE_EVEN, INSIDE = "odd lines in the band", "even lines in the band", "lines in the band"
BETWEEN = "lines between the harmonics"
SECOND, THIRD = "lines above the band, up to twice its end", "lines from twice to three times the band's end"


def excited_lines(periods: SteadyPeriods) -> NDArray[np.bool_]:
    """Which lines were excited, (n_lines,): none far below the largest force or far below its neighbours.

    Parameters
    ----------
    periods
        Steady periods; a line that any realisation and any force excites counts.
    """
    power = np.zeros(len(periods.frequencies))
    for one in periods.realisations:
        own = np.abs(one.forces.mean(axis=0)) ** 2
        power = np.maximum(power, (own / np.maximum(own.max(axis=0), 1e-300)).max(axis=1))
    near = maximum_filter1d(power, 2 * NEIGHBOURS + 1, mode="nearest")
    return np.asarray((power > FAR_BELOW) & (power > BELOW * near))


def silent_classes(periods: SteadyPeriods, excited: NDArray[np.bool_]) -> dict[str, NDArray[np.bool_]]:
    """Lines that were not excited, by what can reach them.

    Harmonics are counted in the largest common divisor of the excited line numbers. Distortion of even order reaches
    even harmonics, and of odd order odd ones, where only odd ones are excited; else both orders reach every line.
    Second order ends at twice the highest line, third order at three times. Lines beside multiples of a mains frequency
    are in no class.

    Parameters
    ----------
    periods
        Steady periods whose forces were excited at these lines.
    excited : (n_lines,)
        Lines that were excited.

    Returns
    -------
    dict
        Name of the class, and its lines, (n_lines,); empty classes are left out.
    """
    numbers = periods.numbers
    if not excited.any():
        return {}
    base = int(np.gcd.reduce(numbers[excited]))
    low, high = int(numbers[excited].min()), int(numbers[excited].max())
    harmonic, odd = numbers % base == 0, (numbers // base) % 2 == 1
    inside = (numbers > low) & (numbers < high) & ~excited
    if np.all(odd[excited]):
        classes = {INSIDE_ODD: inside & harmonic & odd, INSIDE_EVEN: inside & harmonic & ~odd}
        above = {
            f"{name}, {parity}": lines & chosen
            for name, lines in _above(numbers, high).items()
            for parity, chosen in (("odd", odd), ("even", ~odd))
        }
    else:
        classes, above = {INSIDE: inside & harmonic}, _above(numbers, high)
    classes[BETWEEN] = inside & ~harmonic
    classes |= {name: lines & harmonic & ~excited for name, lines in above.items()}
    clean = ~_humming(periods)
    return {name: lines & clean for name, lines in classes.items() if np.any(lines & clean)}


def _humming(periods: SteadyPeriods) -> NDArray[np.bool_]:
    """Lines less than one spacing away from a multiple of a mains frequency, where lines are much closer than these."""
    near = np.zeros(len(periods.frequencies), dtype=bool)
    for mains in MAINS:
        if periods.period * mains > 10:
            away = np.abs(periods.frequencies - mains * np.maximum(1, np.rint(periods.frequencies / mains)))
            near |= away < 0.999 / periods.period
    return near


def _above(numbers: NDArray[np.int64], high: int) -> dict[str, NDArray[np.bool_]]:
    return {
        SECOND: np.asarray((numbers > high) & (numbers <= 2 * high)),
        THIRD: np.asarray((numbers > 2 * high) & (numbers <= 3 * high)),
    }
