"""How much area a modal vector covers in the complex plane."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError


def mode_complexity(vectors: NDArray[np.complex128]) -> NDArray[np.float64]:
    r"""Compute the area of the polygon around a vector's components over the largest circle (Imregun & Ewins 1995).

    *Complex modes: origins and limits*, Proc. IMAC 13: ``area(hull of all components and the origin) / (pi max|x|^2)``,
    0 for components on one line through the origin, as of a real mode; 1 for very many components evenly around a
    circle, as of a travelling wave.

    Parameters
    ----------
    vectors : (n_modes, n_dof), complex
        Mode shapes, one a row.

    Returns
    -------
    (n_modes,), 0 ... 1

    Examples
    --------
    A square in a circle covers ``2 / pi`` of it:

    >>> mode_complexity(np.array([[1, 1j, -1, -1j], [1, -2, 3, 0.5]])).round(3).tolist()
    [0.637, 0.0]
    """
    return np.array([_share(vector) for vector in vectors], dtype=float)


def _share(vector: NDArray[np.complex128]) -> float:
    largest = float(np.abs(vector).max(initial=0.0))
    if largest == 0.0:
        return 0.0
    points = np.append(vector, 0.0) / largest
    try:
        hull = ConvexHull(np.column_stack([points.real, points.imag]))
    except QhullError:  # fewer than three points that are not on one line
        return 0.0
    return float(hull.volume) / np.pi  # in two dimensions the volume is the area
