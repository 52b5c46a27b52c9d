"""The band in which an FRF is known: lines that are valid, driven and coherent, side by side."""

import numpy as np
from numpy.typing import NDArray

from foundation import Band

from .frf import Frf
from .quantities import FRF_ORDERS

COHERENT = 0.5
"""Multiple coherence of the best response from which a line says something of the structure."""

BRIDGED = 8
"""Lines of a gap that is bridged: a multisine drives every second or fourth line, and single lines fail by chance."""


def known_band(frf: Frf, driven: NDArray[np.bool_]) -> Band | None:
    """Find the stretch of known lines that holds most of the structure's motion.

    A line is known where it is valid, driven, above 0 Hz and coherent in one response at least. If there
    are several stretches (a sweep of a cutter drives one for each harmonic of its teeth), the one with the most energy
    of the mobility counts.

    Parameters
    ----------
    frf
        Estimated FRF, with its multiple coherence if it is known.
    driven : (n_frequencies,), bool
        Whether the inputs have power on the line.

    Returns
    -------
    Band or None
        None where fewer than two lines are known.

    Examples
    --------
    >>> axis, ones = np.arange(100.0), np.ones(100, dtype=bool)
    >>> frf = Frf(axis, np.ones((100, 1, 1), complex), ("A:+X",), ("A:+X",), "mobility", "m/s/N", ones)
    >>> known_band(frf, (axis > 20) & (axis < 61))
    (21.0, 60.0)
    """
    f = frf.frequencies
    known = frf.valid & driven & (f > 0)
    if frf.multiple_coherence is not None:
        known &= frf.multiple_coherence.max(axis=1) >= COHERENT
    lines = np.flatnonzero(known)
    if len(lines) < 2:
        return None
    energy = np.sum(np.abs(frf.values) ** 2, axis=(1, 2)) * np.where(f > 0, f, 1.0) ** (
        2.0 - 2.0 * FRF_ORDERS.get(frf.quantity, 1)
    )
    stretches = [part for part in np.split(lines, np.flatnonzero(np.diff(lines) > BRIDGED) + 1) if len(part) > 1]
    if not stretches:
        return None
    best = max(stretches, key=lambda part: float(energy[part].sum()))
    return float(f[best[0]]), float(f[best[-1]])
