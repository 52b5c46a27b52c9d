"""Frequency bands in which a result is valid, and their intersections."""

import math

from .errors import InputError

Band = tuple[float, float]
"""Lowest and highest frequency, Hz."""


def checked_band(band: Band | None, owner: str) -> Band | None:
    """Give the band as two plain numbers, or None where the band of the owner is not known.

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


def shared_band(one: Band | None, other: Band | None) -> Band | None:
    """Give the band in which both results hold; a side that is not known (None) sets no limit.

    Raises
    ------
    InputError
        The two bands have nothing in common.

    Examples
    --------
    >>> shared_band((5.0, 60.0), (13.0, 100.0))
    (13.0, 60.0)
    """
    if one is None or other is None:
        return one if other is None else other
    low, high = max(one[0], other[0]), min(one[1], other[1])
    if low >= high:
        raise InputError(
            f"bands {one[0]:g} to {one[1]:g} Hz and {other[0]:g} to {other[1]:g} Hz have nothing in common; "
            "measure both in one band"
        )
    return low, high
