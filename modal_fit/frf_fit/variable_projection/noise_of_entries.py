"""Noise of each entry of an FRF matrix: from its coherence or repeats, else from neighbouring lines."""

import numpy as np
from numpy.typing import NDArray

from estimation import Frf

from .whitened_lines import noise_correlation

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
_LINES = 15  # over which a variance of few averages is smoothed
_CURVE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # zero on every cubic


def entry_noise(frf: Frf, chosen: NDArray[np.bool_]) -> Real:
    """Variance ``E|dH[p, q]|^2`` on the chosen lines, shape (n_lines, n_responses, n_excitations).

    What the FRF says of its noise (covariance, or coherence and averages) is taken where it says it, smoothed over
    neighbouring lines; entries without it get :func:`neighbour_noise`.
    """
    values = frf.values[chosen]
    flat = np.broadcast_to(neighbour_noise(values) / _seen_by_curve(frf), values.shape)
    stated = frf.entry_variance()
    if stated is None:
        return np.asarray(flat)
    stated = stated[chosen]
    known = np.isfinite(stated).all(axis=0) & (stated.max(axis=0) > 0)
    return np.where(known, np.maximum(_smoothed(stated), 1e-3 * np.median(stated, axis=0)), flat)


def _seen_by_curve(frf: Frf) -> float:
    """Share of the noise that the cubic through five lines leaves where an exponential window correlates them."""
    between = noise_correlation(frf, len(_CURVE) - 1)
    apart = np.subtract.outer(np.arange(len(_CURVE)), np.arange(len(_CURVE)))
    return float(_CURVE @ between[apart + len(_CURVE) - 1] @ _CURVE / np.sum(_CURVE**2))


def neighbour_noise(values: Complex) -> Real:
    """Estimate noise that is white over the lines, from the residual of a cubic through five neighbouring lines.

    ``|x_(k-2) - 4 x_(k-1) + 6 x_k - 4 x_(k+1) + x_(k+2)|^2`` has 70 times the noise's variance. Its median over
    the lines passes resonances by, which are narrow; the median of an exponentially distributed power is ln 2 of the
    mean. A window that correlates neighbouring lines makes the result too small.

    Parameters
    ----------
    values : (n_lines, n_responses, n_excitations)
        Values of the FRF on neighbouring lines.

    Returns
    -------
    (n_responses, n_excitations)

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> noise = rng.standard_normal((2, 4000, 1, 1)) @ np.array([[0.5]])
    >>> curve = np.linspace(-1, 1, 4000)[:, None, None] ** 3
    >>> float(neighbour_noise(curve + noise[0] + 1j * noise[1])[0, 0].round(1))
    0.5
    """
    n = len(values) - len(_CURVE) + 1
    if n < 1:
        return np.asarray(1e-6 * np.mean(np.abs(values) ** 2, axis=0))
    left = sum(weight * values[k : k + n] for k, weight in enumerate(_CURVE))
    power = np.median(np.abs(left) ** 2, axis=0) / (np.log(2) * np.sum(_CURVE**2))
    return np.asarray(np.maximum(power, 1e-20 * np.mean(np.abs(values) ** 2, axis=0) + 1e-300))


def _smoothed(variance: Real) -> Real:
    """Running mean over the lines, ends mirrored."""
    reach = min(_LINES // 2, len(variance) - 1)
    padded = np.concatenate([variance[reach:0:-1], variance, variance[-2 : -reach - 2 : -1]])
    summed = np.cumsum(np.concatenate([np.zeros((1, *variance.shape[1:])), padded]), axis=0)
    width = 2 * reach + 1
    return np.asarray((summed[width:] - summed[:-width]) / width)
