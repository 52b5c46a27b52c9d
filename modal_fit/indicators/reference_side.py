"""The lines and the reference side that mode indicators look at."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from foundation import Band, InputError


def indicated_lines(frf: Frf, band: Band | None) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Give frequencies above 0 Hz and values of the valid lines inside ``band``.

    Parameters
    ----------
    frf
        FRF of any quantity.
    band : Hz
        Lowest and highest frequency; None: all lines.

    Returns
    -------
    (n_lines,), Hz, and (n_lines, n_responses, n_excitations)

    Raises
    ------
    InputError
        No valid line lies there.
    """
    low, high = (0.0, np.inf) if band is None else band
    f = frf.frequencies
    inside = frf.valid & (f > 0) & (f >= low) & (f <= high)
    if not inside.any():
        raise InputError(
            f"no valid line of the FRF lies between {low:g} and {high:g} Hz; it has {f[0]:g} to {f[-1]:g} Hz"
        )
    return f[inside], frf.values[inside]


def references_last(frf: Frf, values: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], tuple[str, ...]]:
    """Values with the side of fewer degrees of freedom as columns, and the names of these references.

    A roving hammer has many excitations and few sensors; by reciprocity its sensors are the references.
    """
    if len(frf.excitations) <= len(frf.responses):
        return values, frf.excitations
    return values.transpose(0, 2, 1), frf.responses
