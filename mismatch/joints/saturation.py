"""The characteristic of a channel that saturates: sharply, or rounding off before its limit."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

Real = NDArray[np.float64]

SOFTEST = 4.0
"""Sharpness below which a characteristic is bent long before its limit: that is no clipping."""

SHARPEST = 60.0
"""Sharpness above which rounding cannot be seen."""

LEAST_GAIN = 20.0
"""Gain in twice the log likelihood from which a rounded limit is preferred to a sharp one."""


@dataclass(frozen=True)
class Saturation:
    """``y = x / (1 + |x / l|^n)^(1 / n)``; a sharp limit has n = infinity.

    Parameters
    ----------
    limit, error
        Limit l in the channel's unit, and its standard error.
    sharpness, sharpness_error
        Sharpness n of the corner, and its standard error.
    """

    limit: float
    error: float
    sharpness: float = np.inf
    sharpness_error: float = 0.0


def saturated(signal: Real, limit: float, sharpness: float = np.inf) -> Real:
    """What a saturating channel shows of a signal.

    Parameters
    ----------
    signal : (n,)
        Signal before the channel, in the channel's unit.
    limit, sharpness
        Numbers l and n of the characteristic, as in :class:`Saturation`.

    Examples
    --------
    >>> saturated(np.array([0.5, 3.0]), 2.0)
    array([0.5, 2. ])
    >>> saturated(np.array([0.5, 2.0]), 2.0, 1.0)
    array([0.4, 1. ])
    """
    if np.isinf(sharpness):
        return np.asarray(np.clip(signal, -limit, limit))
    share = np.abs(signal) / limit
    # far beyond the limit the power of the share may overflow; that of its reciprocal stays finite
    large = np.maximum(share, 1.0)
    within = np.minimum(share, 1.0) ** sharpness
    return np.asarray(signal / large * (large**-sharpness + within) ** (-1 / sharpness))


def rounded(measured: Real, shown: Real, sharp: Saturation) -> Saturation:
    """The characteristic that leaves least of a channel, if rounding it is worth its number.

    Parameters
    ----------
    measured, shown : (n,)
        Samples of the channel as recorded, and as predicted without a limit.
    sharp
        The sharp limit that was found.
    """
    near = np.abs(shown) > 0.5 * sharp.limit
    due, seen = shown[near], measured[near]

    def left(numbers: Real) -> float:
        inverse = float(np.clip(numbers[1], 0.0, 1 / SOFTEST))
        sharpness = 1 / inverse if inverse > 1 / SHARPEST else np.inf
        return float(np.sum((seen - saturated(due, sharp.limit * float(numbers[0]), sharpness)) ** 2))

    start = np.array([[1.0, 0.02], [1.01, 0.06], [1.02, 0.2]])
    best = minimize(
        left, start[1], method="Nelder-Mead", options={"initial_simplex": start, "maxiter": 80, "xatol": 1e-4}
    )
    inverse = float(np.clip(best.x[1], 0.0, 1 / SOFTEST))
    gain = len(seen) * float(np.log(left(np.array([1.0, 0.0])) / max(float(best.fun), 1e-300)))
    if inverse <= 1 / SHARPEST or gain < LEAST_GAIN:
        return sharp
    found = Saturation(sharp.limit * float(best.x[0]), sharp.error, 1 / inverse)
    return _with_errors(found, due, float(best.fun) / len(seen))


def _with_errors(found: Saturation, due: Real, variance: float) -> Saturation:
    """Standard errors to first order, for noise of that variance on what is shown of ``due``."""
    steps = 1e-4 * np.array([found.limit, found.sharpness])
    slopes = []
    for k in range(2):
        above, below = (np.array([found.limit, found.sharpness]) + sign * steps * np.eye(2)[k] for sign in (1, -1))
        slopes.append((saturated(due, *above) - saturated(due, *below)) / (2 * steps[k]))
    slope = np.array(slopes)
    spread = np.sqrt(variance * np.diag(np.linalg.pinv(slope @ slope.T)))
    return replace(found, error=float(spread[0]), sharpness_error=float(spread[1]))
