"""Paired tests over blocks of time, and errors of parameters that include the form of the law."""

import numpy as np
import scipy

from millfrf.core import Real

DRAWS = 1000
"""Resamples of the bootstrap over blocks."""


def signed_ranks(before: Real, after: Real) -> float:
    """p-value that ``after`` is not below ``before`` (Wilcoxon's signed ranks, Biometrics Bulletin 1, 1945).

    Parameters
    ----------
    before, after : (n_blocks,)
        Power of the residual in the same blocks of time, under two hypotheses.

    Examples
    --------
    >>> signed_ranks(np.arange(2.0, 12.0), np.arange(1.0, 11.0)) < 0.01
    True
    >>> signed_ranks(np.ones(4), np.ones(4))
    1.0
    """
    fall = before - after
    return float(scipy.stats.wilcoxon(fall, alternative="greater").pvalue) if fall.any() else 1.0


def students_test(before: Real, after: Real) -> float:
    """p-value by Student's test of the mean fall, for so few blocks that ranks cannot be significant.

    Parameters
    ----------
    before, after : (n_blocks,)
        Power of the residual in the same blocks of time, under two hypotheses.
    """
    fall = before - after
    return float(scipy.stats.ttest_1samp(fall, 0.0, alternative="greater").pvalue) if np.ptp(fall) > 0 else 1.0


def ratio_interval(before: Real, after: Real) -> tuple[float, float]:
    """95 % interval of ``sqrt(sum after / sum before)``, bootstrapped over blocks (Efron & Tibshirani, 1993, ch. 13).

    Parameters
    ----------
    before, after : (n_blocks,)
        Power of the residual in the same blocks of time, under two hypotheses.
    """
    draw = np.random.default_rng(0).integers(0, len(before), (DRAWS, len(before)))
    ratio = np.sqrt(after[draw].sum(axis=1) / before[draw].sum(axis=1))
    low, high = np.quantile(ratio, [0.025, 0.975])
    return float(low), float(high)


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
