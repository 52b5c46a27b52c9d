"""Noise of a recording: what is smooth over octaves of its spectrum."""

import numpy as np
import scipy

from millfrf.core import Real

from ..settings import THRESHOLDS
from .lines import Spectrum
from .spindle import Revolutions

_LEAST_LINES = 60  # from which the noise is estimated


def noise_of(spectrum: Spectrum) -> Real:
    """Return the mean square of the noise of each channel, (n_channels,).

    The noise of sensors, of a microphone's surroundings and of chips that form is smooth over octaves; motion has
    lines, and humps at modes.
    """
    used = spectrum.searched & (spectrum.orders > 0)
    if used.sum() < _LEAST_LINES:
        return np.zeros(spectrum.power.shape[1])
    floor = _one_sided_floor(spectrum.orders[used], spectrum.power[used], spectrum.averages)
    return np.asarray(floor.mean(axis=0) * (spectrum.orders <= spectrum.orders[used][-1]).sum())


def motion_of(late: Revolutions, noise: Real) -> Real:
    """Return the mean square of the motion of each channel without the noise, (n_channels,)."""
    size = late.size**2
    return np.asarray(np.maximum(size - noise, THRESHOLDS.negligible * size))


def _one_sided_floor(orders: Real, power: Real, averages: float) -> Real:
    """Estimate the mean power of noise like :func:`wide_floor`, from the octave below or above, where it is more.

    Filters and codecs cut a spectrum off, so that an octave on one side may hold nothing.
    """
    places = np.geomspace(orders[0], orders[-1], 40)
    low, middle, high = (np.searchsorted(orders, factor * places) for factor in (0.5, 1.0, 2.0))
    has_above = 2 * places <= orders[-1]
    share = scipy.special.gammaincinv(averages, 0.2) / averages
    values = np.zeros((len(places), power.shape[1]))
    for number, (first, place, last) in enumerate(zip(low, middle, high, strict=True)):
        sides = [power[first : place + 1]] + [power[place:last]] * bool(has_above[number])
        fifths = [np.partition(side, len(side) // 5, axis=0)[len(side) // 5] for side in sides if len(side)]
        values[number] = np.max(fifths, axis=0) / share
    return np.column_stack([np.interp(orders, places, column) for column in values.T])


def wide_floor(orders: Real, power: Real, averages: float) -> Real:
    """Estimate the mean power of noise from the weakest fifth of the lines within an octave on either side.

    The result has the shape of ``power``, an average over this many independent segments.
    """
    places = np.geomspace(orders[0], orders[-1], 60)
    low, high = np.searchsorted(orders, places / 2.0), np.searchsorted(orders, places * 2.0)
    # noise power has a gamma distribution (see Spectrum.p_values): its 20 % quantile over its mean
    share = scipy.special.gammaincinv(averages, 0.2) / averages
    values = np.array([np.quantile(power[a:b], 0.2, axis=0) / share for a, b in zip(low, high, strict=True)])
    logarithm = np.log(np.maximum(values, 1e-300))
    columns = [np.interp(np.log(orders), np.log(places), column) for column in logarithm.T]
    return np.asarray(np.exp(np.column_stack(columns)))
