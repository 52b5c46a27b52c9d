"""Residual power in cells of time and frequency, regressed on what the prediction has there. Compiled."""

import numpy as np
from numpy.typing import NDArray

from cutting import compiled

Real = NDArray[np.float64]


@compiled
def moving_power(rest: Real, shown: Real, bins: int) -> float:
    """Power of a residual that the prediction's power accounts for, in blocks of neighbouring bins.

    ``P_rest = a + b P_same cell + c P_all frequencies`` with a, b, c >= 0 by weighted least squares; cells of noise
    scatter like their level, so each is weighed by it, once from the mean and twice from the last fit.

    Parameters
    ----------
    rest, shown : (n_bins, n_segments)
        Power of the residual and of the prediction in cells of time and frequency.
    bins
        Number of neighbouring bins that share one noise level.
    """
    count = rest.shape[1]
    together = np.zeros(count)
    for k in range(len(shown)):
        together += shown[k] / len(shown)
    broad = max(together.mean(), 1e-300)
    moving = 0.0
    for start in range(0, len(rest), bins):
        stop = min(start + bins, len(rest))
        level = max(rest[start:stop].mean(), 1e-300)
        same = max(shown[start:stop].mean(), 1e-300)
        factors = np.array([level, 0.0, 0.0])
        flat = True
        for _ in range(3):
            matrix, target, column = np.zeros((3, 3)), np.zeros(3), np.ones(3)
            for k in range(start, stop):
                for t in range(count):
                    column[1], column[2] = shown[k, t] / same, together[t] / broad
                    expected = level if flat else max(float(np.sum(column * factors)), 0.1 * level)
                    for i in range(3):
                        target[i] += column[i] * rest[k, t] / expected**2
                        for j in range(3):
                            matrix[i, j] += column[i] * column[j] / expected**2
            factors = _not_negative(matrix, target)
            flat = False
        moving += (stop - start) * count * (factors[1] + factors[2])
    return moving


@compiled
def _not_negative(matrix: Real, target: Real) -> Real:
    """Least squares with factors of at least zero, from three normal equations: the best of all subsets."""
    best, lowest = np.zeros(3), 0.0
    for subset in range(1, 8):
        chosen = [k for k in range(3) if subset >> k & 1]
        part, right = np.empty((len(chosen), len(chosen))), np.empty(len(chosen))
        for a in range(len(chosen)):
            right[a] = target[chosen[a]]
            for b in range(len(chosen)):
                part[a, b] = matrix[chosen[a], chosen[b]]
            # columns may be all but equal
            part[a, a] *= 1.0 + 1e-12
        found = np.linalg.solve(part, right)
        cost = -float(np.sum(found * right))
        if found.min() >= 0.0 and cost < lowest:
            lowest = cost
            best[:] = 0.0
            for a in range(len(chosen)):
                best[chosen[a]] = found[a]
    return best
