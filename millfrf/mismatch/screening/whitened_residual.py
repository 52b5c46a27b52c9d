"""Residual of a linear fit, whitened by a noise floor, with the modal parameters projected out."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..models.first_motion import predict_lines, with_first_motion_adapted
from ..models.fitting import Fit
from ..models.hypothesis import Predicted
from ..models.misfit import fitted_noise, jacobian, levels, through_structure, whitened
from ..models.settings import FITTING
from ..records.noise_model import whitening

# relative noise of the forces over the relative noise floor of the responses; only affects the order of candidates
FORCE_SHARE = 0.5

DEPENDENT = 1e-12  # share of a column that is not yet fitted, below which the column is a combination of fitted ones


@dataclass(frozen=True)
class FloorRecord:
    """Residual of one recording, whitened by the noise floor."""

    lines: WindowedSpectrum  # windowed spectrum of the recording
    predicted: Predicted  # prediction of the fit
    residual: Complex  # residual lines, measured minus predicted, (n_lines, n_responses)
    through: Complex  # matrix from forces to responses at the lines, (n_lines, n_responses, n_excitations)
    white: Complex  # whitening of each line, lower triangular, (n_lines, n_responses, n_responses)
    # whitened derivative of the lines by all fitted numbers, real parts above imaginary parts,
    # (2 * n_lines * n_responses, size)
    slope: Real
    white_residual: Real  # whitened residual lines, real above imaginary part, (2 * n_lines * n_responses,)

    def column(self, response: Complex) -> Real:
        """Return whitened response lines in a real column, real parts above imaginary parts.

        The first motion of a short recording adapts to the response.
        """
        column = response[:, :, None]
        if self.predicted.first_slopes is not None:
            parts = np.array([column.real, column.imag])
            column = with_first_motion_adapted(self.predicted, self.lines, parts)
        return whitened(self.white, column)[:, 0]


@dataclass(frozen=True)
class Floor:
    """Whitened residuals of all recordings, and the normal matrix of everything that is already fitted."""

    records: tuple[FloorRecord, ...]
    inverse: Real  # inverse of the normal matrix, which includes the prior, (size, size)
    gradient: Real  # right-hand side of the normal equations, which includes the prior, (size,)

    def gain_of(self, columns: Sequence[Real]) -> "Gain":
        """Return the gain in misfit of further columns together.

        ``columns`` holds the whitened columns (2 * n_lines * n_responses, n) of each recording.
        """
        pairs = list(zip(self.records, columns, strict=True))
        own = 2 * np.sum([part.T @ part for part in columns], axis=0)
        shared = 2 * np.sum([record.slope.T @ part for record, part in pairs], axis=0)
        gradient = 2 * np.sum([part.T @ record.white_residual for record, part in pairs], axis=0)
        solved = self.inverse @ shared
        scale = 1 / np.sqrt(np.maximum(np.diag(own), 1e-300))
        reduced = scale[:, None] * (own - shared.T @ solved) * scale
        reduced_gradient = scale * (gradient - solved.T @ self.gradient)
        values, vectors = np.linalg.eigh(reduced)
        part = vectors[:, values > DEPENDENT]
        step = part @ (part.T @ reduced_gradient / values[values > DEPENDENT])
        return Gain(float(reduced_gradient @ step), scale * step)


@dataclass(frozen=True)
class Gain:
    """Gain in misfit of further columns, if everything that is already fitted adapts to them."""

    gain: float
    factors: Real  # best factor of each column, (n_columns,)


def linear_floor(fitted: Fit, lines: list[WindowedSpectrum]) -> Floor:
    """Whiten the residual of a fit by a low estimate of the noise.

    The noise floor of a response is the level that its residual does not exceed in a fifth of all narrow bands. A
    missing cause that appears at resonances does not raise this floor, whereas the fitted noise model may contain it.
    """

    def covariance(k: int, residual: Complex, through: Complex, few: WindowedSpectrum) -> Complex:
        del few
        return _floor_covariance(residual, through, levels(lines[k]))

    return _floor(fitted, lines, covariance)


def noise_floor(fitted: Fit, lines: list[WindowedSpectrum]) -> Floor:
    """Whiten the residual of a fit by its fitted noise.

    The fit is optimal for this noise, so that gains are those of a score test.
    """

    def covariance(k: int, residual: Complex, through: Complex, few: WindowedSpectrum) -> Complex:
        del residual
        return fitted_noise(few, through, fitted.noises[k])

    return _floor(fitted, lines, covariance)


def _floor(
    fitted: Fit, lines: list[WindowedSpectrum], covariance: Callable[[int, Complex, Complex, WindowedSpectrum], Complex]
) -> Floor:
    """Whiten the residuals of all recordings; a long recording is thinned, and its remaining lines get more weight."""
    records = []
    size = fitted.hypothesis.size
    matrix, gradient = np.zeros((size, size)), np.zeros(size)
    precision = np.full(size, 1e-6)
    precision[: fitted.hypothesis.shape.size] = fitted.hypothesis.shape.prior_precision
    for k, recording in enumerate(lines):
        thinned = recording.thinned(FITTING.thinned_lines)
        weight = len(recording.frequencies) / len(thinned.frequencies)
        predicted = predict_lines(fitted.hypothesis, thinned)
        residual = thinned.measured - predicted.response
        through = through_structure(fitted.hypothesis, thinned)
        white = whitening(covariance(k, residual, through, thinned)) * np.sqrt(weight)
        stacked = whitened(white, jacobian(fitted.hypothesis, thinned, predicted))
        record = FloorRecord(
            thinned, predicted, residual, through, white, stacked, whitened(white, residual[:, :, None])[:, 0]
        )
        records.append(record)
        matrix += 2 * stacked.T @ stacked
        gradient += 2 * stacked.T @ record.white_residual
    gradient[: fitted.hypothesis.shape.size] -= fitted.hypothesis.shape.prior_precision * fitted.hypothesis.u
    return Floor(
        tuple(records), np.asarray(np.linalg.pinv(matrix + np.diag(precision), hermitian=True), dtype=float), gradient
    )


def _floor_covariance(residual: Complex, through: Complex, level: tuple[Real, Real]) -> Complex:
    bands = np.array_split(np.abs(residual) ** 2, min(150, max(4, len(residual) // 12)))
    # in the quietest fifth of the bands the level is below the mean noise by chance
    count = float(np.mean([len(band) for band in bands]))
    quiet = (
        np.quantile(np.array([band.mean(axis=0) for band in bands]), 0.2, axis=0)
        * count
        / scipy.stats.gamma.ppf(0.2, count)
    )
    share = np.median(np.sqrt(quiet) / level[0])
    force_noise = through * (FORCE_SHARE * share * level[1])
    covariance = force_noise @ force_noise.conj().swapaxes(1, 2)
    diagonal = np.arange(residual.shape[1])
    covariance[:, diagonal, diagonal] += quiet
    return np.asarray(covariance)
