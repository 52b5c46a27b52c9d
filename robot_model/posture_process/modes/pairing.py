"""Which measured mode is which computed one: by frequency and by the motion of the tip."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

Real = NDArray[np.float64]

AT_FIRST, KNOWN = (0.12, 0.35), (0.05, 0.3)
"""Differences that weigh the same, of the logarithm of frequency and of the tip's motion as a share of it: of a model
as it is, and of one that was corrected."""

FARTHEST = 0.5
"""Logarithm of a ratio of frequencies beyond which two modes are never the same."""


def mode_pairs(
    frequencies: Real, shapes: Real, computed: Real, moved: Real, scales: tuple[float, float] = AT_FIRST
) -> tuple[tuple[int, int], ...]:
    """Pair measured modes with computed ones at the least total distance.

    ``(log f / g)^2 / a^2 + min |phi -+ psi|^2 / (b^2 |phi| |psi|)``, with a and b of ``scales``.

    Parameters
    ----------
    frequencies : (n_measured,), Hz
        Measured natural frequencies.
    shapes : (n_measured, n_directions)
        Measured motion of the tip.
    computed : (n_computed,), Hz
        Computed natural frequencies.
    moved : (n_computed, n_directions)
        Computed motion of the tip along the same directions.
    scales
        Differences of frequency and of shape that weigh the same.

    Returns
    -------
    Pairs (measured, computed) in the order of the measured modes; modes farther apart than ``FARTHEST`` have none.

    Examples
    --------
    >>> turned = np.eye(2)[::-1]
    >>> mode_pairs(np.array([10.0, 10.5]), np.eye(2), np.array([10.2, 10.3]), turned)
    ((0, 1), (1, 0))
    """
    ratio = np.log(frequencies)[:, None] - np.log(computed)[None, :]
    first, second = np.linalg.norm(shapes, axis=1), np.linalg.norm(moved, axis=1)
    both = np.maximum(np.outer(first, second), 1e-30)
    apart = (first[:, None] ** 2 + second[None, :] ** 2 - 2 * np.abs(shapes @ moved.T)) / both
    cost = (ratio / scales[0]) ** 2 + np.minimum(apart, 4.0) / scales[1] ** 2
    cost[np.abs(ratio) > FARTHEST] = 1e4
    rows, columns = linear_sum_assignment(cost)
    return tuple((int(i), int(j)) for i, j in zip(rows, columns, strict=True) if cost[i, j] < 1e4)
