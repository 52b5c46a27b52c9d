"""Array types for annotations; frequency bands in which a result is valid, and their intersections."""

import math

import numpy as np
from numpy.typing import NDArray

from .errors import InputError

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]
Index = NDArray[np.int64]

Band = tuple[float, float]
"""Lowest and highest frequency, Hz."""


def checked_band(band: Band | None, owner: str) -> Band | None:
    """Return a band as two floats; return None for an unknown band.

    Parameters
    ----------
    band
        Lowest and highest frequency, Hz, or None.
    owner
        Name of what carries the band, for the message: ``modal model``, ``FRF``.

    Returns
    -------
    Band or None

    Raises
    ------
    InputError
        Edges that are not finite, negative, or not increasing.

    Examples
    --------
    >>> checked_band((12, 24), "modal model")
    (12.0, 24.0)
    """
    if band is None:
        return None
    low, high = float(band[0]), float(band[1])
    if not (math.isfinite(low) and math.isfinite(high) and 0 <= low < high):
        raise InputError(f"{owner}: band {low:g} to {high:g} Hz is not two increasing frequencies; give LO HI in Hz")
    return low, high


def shared_band(first: Band | None, second: Band | None) -> Band | None:
    """Return the common part of two bands; an unknown band (None) sets no limit.

    Raises
    ------
    InputError
        The two bands have nothing in common.

    Examples
    --------
    >>> shared_band((5.0, 60.0), (13.0, 100.0))
    (13.0, 60.0)
    """
    if first is None or second is None:
        return first if second is None else second
    low, high = max(first[0], second[0]), min(first[1], second[1])
    if low >= high:
        raise InputError(
            f"bands {first[0]:g} to {first[1]:g} Hz and {second[0]:g} to {second[1]:g} Hz have nothing in common; "
            "measure both in one band"
        )
    return low, high
