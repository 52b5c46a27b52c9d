"""The lines and the reference side that mode indicators look at."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf
from foundation import Band, InputError


def indicated_columns(
    frf: Frf, band: Band | None
) -> tuple[NDArray[np.float64], NDArray[np.complex128], tuple[str, ...]]:
    """Give the valid lines inside a band, with the side of fewer degrees of freedom as columns: the references.

    A roving hammer has many excitations and few sensors; by reciprocity its sensors are the references.

    Parameters
    ----------
    frf
        FRF of any quantity.
    band : Hz
        Lowest and highest frequency; None: all lines.

    Returns
    -------
    frequencies : (n_lines,), Hz
        Frequencies of the lines, above 0 Hz.
    columns : (n_lines, n_others, n_references)
        Values of the FRF, transposed where there are more excitations than responses.
    references
        Degrees of freedom of the columns.

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
    if len(frf.excitations) <= len(frf.responses):
        return f[inside], frf.values[inside], frf.excitations
    return f[inside], frf.values[inside].transpose(0, 2, 1), frf.responses
