"""Motion that neither repeats nor is a line, but stands out of the noise: irregular chatter."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from .lines import Spectrum
from .tool_motion import ToolMotion

Real = NDArray[np.float64]

ABOVE = 3.0
"""Mean power of neighbouring lines over the floor from which it counts."""
_NEIGHBOURS = 15
_LOWEST = 0.1  # of the tooth passing
_QUANTILE = 0.2  # of exponentially distributed power, which is -ln(1 - 0.2) of its mean
_PLACES = 60  # at which the floor is computed
_WIDE = 2.0  # a floor from half to twice a frequency
_BESIDE = 5  # lines on either side of a tone that are left out


def irregular_change(spectrum: Spectrum, motion: ToolMotion, tones: Real) -> float:
    """Root mean square of the chip's change by what stands out of a floor two octaves wide, over the thickest chip.

    The noise of sensors is smooth over octaves; motion of the structure has humps at its modes.

    Parameters
    ----------
    spectrum
        Spectrum of what does not repeat with the revolution.
    motion
        Channels of the tool's motion, and the thickest chip.
    tones : (n_tones,)
        Orders of foreign tones, which do not count.
    """
    used = spectrum.searched & (spectrum.orders > _LOWEST * motion.teeth)
    for tone in tones:
        used &= np.abs(spectrum.orders - tone) > _BESIDE * spectrum.resolution
    orders, power = spectrum.orders[used], spectrum.power[used]
    if len(orders) < _NEIGHBOURS:
        return 0.0
    counted = motion.scales > 0
    floor = _wide_floor(orders, power)
    stands = uniform_filter1d(power, _NEIGHBOURS, axis=0) > ABOVE * floor
    return motion.change(orders, np.where(stands & counted, np.maximum(power - floor, 0.0), 0.0))


def _wide_floor(orders: Real, power: Real) -> Real:
    """Mean power that the weakest fifth of the lines within an octave on either side speaks for, as ``power``."""
    places = np.geomspace(orders[0], orders[-1], _PLACES)
    low, high = np.searchsorted(orders, places / _WIDE), np.searchsorted(orders, places * _WIDE)
    share = -np.log(1 - _QUANTILE)
    values = np.array([np.quantile(power[a:b], _QUANTILE, axis=0) / share for a, b in zip(low, high, strict=True)])
    logarithm = np.log(np.maximum(values, 1e-300))
    columns = [np.interp(np.log(orders), np.log(places), column) for column in logarithm.T]
    return np.asarray(np.exp(np.column_stack(columns)))
