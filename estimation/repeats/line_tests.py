"""Tests over many lines: one p-value of all, and which lines stand out."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


def ratio_p_values(ratio: Real, above: Real | float, below: Real | float) -> Real:
    """Probability of a ratio of mean squares of complex Gaussian values at least as large, same shape as ``ratio``.

    Parameters
    ----------
    ratio
        Mean square over the variance that noise of its own measurement gives.
    above, below
        Complex degrees of freedom of numerator and denominator; twice as many real ones enter the F distribution.
    """
    from scipy.special import fdtrc

    return np.asarray(fdtrc(2 * np.asarray(above), 2 * np.asarray(below), np.maximum(ratio, 0.0)))


def together(p_values: Real) -> float:
    """One p-value of independent ones (n,): ``-2 sum ln p`` is chi-squared with 2 n degrees (Fisher 1925).

    Examples
    --------
    >>> round(together(np.array([0.5, 0.5])), 3), together(np.full(100, 0.01)) < 1e-50
    (0.597, True)
    """
    from scipy.special import chdtrc

    return float(chdtrc(2.0 * p_values.size, -2 * np.sum(np.log(np.maximum(p_values, 1e-300)))))


def standing_out(p_values: Real, rate: float = 0.05) -> NDArray[np.bool_]:
    """Which of p-values (n,) stand out, with a share ``rate`` of false ones among them.

    Benjamini & Hochberg, J. R. Stat. Soc. B 57, 289 (1995).

    Examples
    --------
    >>> standing_out(np.array([1e-6, 0.3, 0.04, 0.9])).tolist()
    [True, False, False, False]
    """
    order = np.argsort(p_values)
    below = np.flatnonzero(p_values[order] <= rate * np.arange(1, len(order) + 1) / len(order))
    chosen = np.zeros(len(order), dtype=bool)
    if len(below):
        chosen[order[: below[-1] + 1]] = True
    return chosen
