"""Fits by least squares that infer no noise: every line counts alike, over all recordings or over each of them."""

import numpy as np

from estimation import WindowedSpectrum

from ..noise import flat_noise
from .fitting import Fit, fit
from .hypothesis import Hypothesis

EXACT = 0.01
"""Error, over the response, that a plain fit takes every line to have."""


def plain_fit(lines: list[WindowedSpectrum], start: Hypothesis, *, iterations: int, exact: float = EXACT) -> Fit:
    """Fit by unweighted least squares: every line counts alike, at whatever frequency and level.

    No noise is inferred. Each response is scaled by its power over all recordings, and the lab's belief hardly counts.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    start
        Hypothesis that the fit begins with.
    iterations
        Number of steps at most.
    exact
        Error, over the response, that every line is taken to have: the larger it is, the more the lab's belief counts.
    """
    power = np.mean([np.mean(np.abs(one.measured) ** 2, axis=0) for one in lines], axis=0)
    noises = tuple(flat_noise(one.frequencies, exact**2 * power, one.force_here.shape[1]) for one in lines)
    return fit(lines, start, noises, iterations=iterations, held=True)


def even_fit(lines: list[WindowedSpectrum], fitted: Fit, *, iterations: int, exact: float = EXACT) -> Fit:
    """Fit by least squares on shares of the response: a weak recording counts as much as a loud one.

    ``sum_k sum |r_k|^2 / P_k`` is minimised, with the power P_k of each response in recording k. Where no law has the
    true form, no noise describes what is left: a likelihood then follows the lines it takes for quiet, and plain least
    squares follow the loudest recording. The noise of the answer is estimated at its end.

    Parameters
    ----------
    lines
        Windowed spectra of the recordings that are compared.
    fitted
        A fit under inferred noise, with which this one begins; it may know of no noise.
    iterations
        Number of steps at most.
    exact
        Error, over the response, that every line is taken to have: the larger it is, the more the lab's belief counts.

    Returns
    -------
    Fit
        Its score is that of the likelihood, as for :func:`fit`; infinite where it runs away.
    """
    noises = tuple(
        flat_noise(one.frequencies, exact**2 * np.mean(np.abs(one.measured) ** 2, axis=0), one.force_here.shape[1])
        for one in lines
    )
    even = fit(lines, fitted.hypothesis, noises, iterations=iterations, held=True)
    return fit(lines, even.hypothesis, fitted.noises or None, iterations=0) if np.isfinite(even.score) else even
