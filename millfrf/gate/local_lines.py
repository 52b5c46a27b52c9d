"""Doubts about local polynomials: errors shared by neighbouring lines, and lines with large ones."""

import numpy as np

from estimation import Frf, bands_text, local_half_width

NOISY = 0.3
"""Standard error of the whole matrix on a line, over its size, from which a line is told."""

SHARE = 0.02
"""Share of the lines that may be so without a word."""


def check_local_frf(frf: Frf, n_tests: int) -> list[str]:
    """Doubt the error bars of fits to a local-polynomial FRF, and lines on which it hardly saw the structure.

    The transient of a record is smooth in frequency; so is a slow sweep's force. What cannot be told apart has large
    error bars, which a fit takes into account and a reader of the curves should know of.

    Parameters
    ----------
    frf
        FRF with the covariance that :func:`estimation.local_polynomial` gives.
    n_tests
        Number of records behind it.
    """
    lines = 2 * local_half_width(n_tests, len(frf.excitations)) + 1
    shared = (
        f"errors of {lines} neighbouring lines are correlated (a window of local polynomials): a fit's error bars are "
        f"too small by up to {np.sqrt(lines):.0f} times"
    )
    return [shared, *_noisy_lines(frf)]


def _noisy_lines(frf: Frf) -> list[str]:
    variance = frf.entry_variance()
    if variance is None or not frf.valid.any():
        return []
    size = np.sqrt(np.sum(np.abs(frf.values) ** 2, axis=(1, 2)))
    error = np.sqrt(np.sum(variance, axis=(1, 2)))
    noisy = frf.valid & (error > NOISY * size)
    if noisy.sum() <= SHARE * frf.valid.sum():
        return []
    return [
        f"on {int(noisy.sum())} of {int(frf.valid.sum())} lines ({bands_text(frf.frequencies, noisy)}) the standard "
        f"error is above {100 * NOISY:.0f} % of the FRF: the force is weak there, or too smooth in frequency for local "
        "polynomials, as that of a slow sweep; compare with --estimator h1"
    ]
