"""Weights of the measured lines: from a stated covariance, else from the noise of each entry and what a fit leaves."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf

from .mode_selection import Reweigh
from .variable_projection import Elimination, MeasuredLines, Real, correlated_lines, entry_noise, measured_lines


def line_weights(frf: Frf, inside: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Weights of the lines for the poly-reference poles, from the stated noise; None where no noise is stated.

    Parameters
    ----------
    frf
        The measured FRF matrix.
    inside : (n_frequencies,)
        Which lines are fitted; all others have the weight zero.
    """
    variance = frf.entry_variance() if frf.covariance is not None else None
    if variance is None:
        return None
    summed = variance[inside].sum(axis=(1, 2))
    weights = np.zeros(len(frf.frequencies))
    weights[inside] = 1 / np.maximum(summed, 1e-3 * np.median(summed))
    return weights


def weighted_lines(frf: Frf, inside: NDArray[np.bool_], band: tuple[float, float]) -> tuple[MeasuredLines, Reweigh]:
    """The lines with their first weights, and the rule for the next ones.

    A stated covariance stays. Else each entry counts alike at first; then what a fit leaves of an entry beyond its
    noise is taken for flat noise of that entry, in the measured quantity. Flat, because an error that follows the
    resonances, which a misfit does, would take the weight from them.

    Parameters
    ----------
    frf
        The measured FRF matrix.
    inside : (n_frequencies,)
        Which lines are fitted.
    band
        Lower and upper edge of the band (Hz).
    """
    if frf.covariance is not None:
        return correlated_lines(frf, inside, band), _unchanged
    noise = entry_noise(frf, inside)
    power = np.mean(np.abs(frf.values[inside]) ** 2, axis=0)
    first = measured_lines(frf, inside, band, np.broadcast_to(np.where(power > 0, power, 1.0), noise.shape))
    first = replace(first, noise=_noise_power(noise, first))

    def reweigh(lines: MeasuredLines, found: Elimination) -> MeasuredLines:
        misfit = _entry_misfit(found, lines)
        extra = np.maximum(misfit - noise.mean(axis=0), 0.0)
        again = measured_lines(frf, inside, band, noise + extra)
        return replace(again, noise=_noise_power(noise, again))

    return first, reweigh


def _unchanged(lines: MeasuredLines, found: Elimination) -> MeasuredLines:
    return lines


def _noise_power(noise: Real, lines: MeasuredLines) -> Real:
    """Power of the noise alone on each line, in the units of the whitened values."""
    whitened = noise.transpose(0, 2, 1) * lines.weights[:, :, None] ** 2 * np.diag(lines.whitening) ** 2
    return np.asarray(whitened.sum(axis=(1, 2)))


def _entry_misfit(found: Elimination, lines: MeasuredLines) -> Real:
    """Mean squared misfit of each entry, in its own unit, (n_responses, n_excitations)."""
    n_lines, n_columns = lines.weights.shape
    squared = (found.error**2).reshape(2, n_lines, n_columns, -1).sum(axis=0) / lines.weights[:, :, None] ** 2
    return np.asarray(squared.mean(axis=0).T / np.diag(lines.whitening)[:, None] ** 2)
