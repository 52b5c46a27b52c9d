"""What numbers owe to the form of a hypothesis: between parts of the data, and with another cause beside it."""

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]


def jackknife_variance(numbers: Real) -> Real:
    """Variance ``(n - 1) / n sum (theta_i - mean)^2`` of numbers fitted with one part left out each time, (n_numbers,).

    Efron & Tibshirani, An Introduction to the Bootstrap, 1993, chapter 11.

    Parameters
    ----------
    numbers : (n_parts, n_numbers)
        Numbers fitted without the first part, without the second, and so on.

    Examples
    --------
    >>> jackknife_variance(np.array([[1.0], [3.0]])).tolist()
    [1.0]
    """
    count = len(numbers)
    return np.asarray((count - 1) / count * np.sum((numbers - numbers.mean(axis=0)) ** 2, axis=0))


def shift_weight(gain: float) -> float:
    """Weight ``1 - exp(-gain / 2)`` of the shift that a further free cause makes: what it gains decides what it says.

    Parameters
    ----------
    gain
        Fall of the cost when the further cause is free.
    """
    return float(1 - np.exp(-max(gain, 0.0) / 2))
