"""Means of the power of spectral lines in bands, as all maps and spectra of a residual take them."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


def band_means(frequencies: Real, power: Real, edges: Real) -> tuple[Real, Real]:
    """Return the mean power in each band, (n_bands, n), and the number of lines that each holds, (n_bands,).

    A line on an edge belongs to the band above it; lines beyond the first and the last edge belong to the first and
    the last band. The mean of a band without lines is nan.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines.
    power : (n_lines, n)
        Power of each line, in n columns.
    edges : (n_bands + 1,), Hz
        Edges of the bands, rising.

    Examples
    --------
    >>> means, held = band_means(np.array([1.0, 2.0, 3.0]), np.array([[4.0], [2.0], [8.0]]), np.array([1.0, 3.0, 4.0]))
    >>> means.tolist(), held.tolist()
    ([[3.0], [8.0]], [2.0, 1.0])
    """
    place = np.digitize(frequencies, edges[1:-1])
    held = np.bincount(place, minlength=len(edges) - 1).astype(float)
    sums = np.array([np.bincount(place, column, len(held)) for column in power.T]).T
    return np.where(held[:, None] > 0, sums / np.maximum(held, 1)[:, None], np.nan), held
