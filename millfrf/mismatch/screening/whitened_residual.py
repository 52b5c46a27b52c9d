"""A refitted linear model's residual, whitened by a cautious noise floor, with the modal parameters projected out."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from estimation import WindowedSpectrum
from millfrf.core import Complex, Real

from ..models.fitting import ENOUGH, Fit
from ..models.hypothesis import predict_lines
from ..models.line_slopes import jacobian
from ..models.misfit import fitted_noise, levels, through_structure, whitened
from ..noise.noise_model import whitening

FORCE_SHARE = 0.5
"""Noise share of forces against responses on the floor; only the order of candidates depends on it."""


@dataclass(frozen=True)
class FloorRecord:
    """One recording's residual seen from the floor.

    Parameters
    ----------
    lines
        Windowed spectrum of the recording.
    residual : (n_lines, n_responses)
        Windowed lines of the residual, measured minus predicted.
    through : (n_lines, n_responses, n_excitations)
        Matrix from forces to responses at the lines.
    white : (n_lines, n_responses, n_responses)
        Whitening of each line under the floor, lower triangular.
    slope : (2 * n_lines * n_responses, size)
        Whitened derivative by everything fitted, real above imaginary part.
    rest : (2 * n_lines * n_responses,)
        Whitened residual lines, real above imaginary part.
    """

    lines: WindowedSpectrum
    residual: Complex
    through: Complex
    white: Complex
    slope: Real
    rest: Real

    def column(self, response: Complex) -> Real:
        """Whitened response lines as one real column."""
        return whitened(self.white, response[:, :, None])[:, 0]


@dataclass(frozen=True)
class Floor:
    """All recordings on the floor, and the normal matrix of what is already fitted.

    Parameters
    ----------
    records
        Residual of each recording on the floor.
    inverse : (size, size)
        Inverse of the normal matrix, the lab's belief included.
    gradient : (size,)
        Right-hand side of the normal equations, the lab's belief included.
    """

    records: tuple[FloorRecord, ...]
    inverse: Real
    gradient: Real

    def gains(self, columns: list[list[Real]]) -> tuple[Real, Real]:
        """What one more column (given for each recording) would gain in misfit, and its best factor.

        Parameters
        ----------
        columns
            Whitened column of each candidate in every recording.

        Returns
        -------
        gain, factor : (n_candidates,)
        """
        gains, factors = [], []
        for parts in columns:
            own = 2 * sum(float(part @ part) for part in parts)
            shared = 2 * sum(record.slope.T @ part for record, part in zip(self.records, parts, strict=True))
            pull = 2 * sum(float(part @ record.rest) for record, part in zip(self.records, parts, strict=True))
            solved = self.inverse @ shared
            left = own - float(shared @ solved)
            drive = pull - float(solved @ self.gradient)
            factor = drive / left if left > 1e-12 * own else 0.0
            gains.append(drive * factor)
            factors.append(factor)
        return np.array(gains), np.array(factors)


def linear_floor(fitted: Fit, lines: list[WindowedSpectrum]) -> Floor:
    """Put a fit's residual on a cautious floor.

    The floor of a response is the level below which its residual lies in a fifth of all narrow bands: an omission that
    shows at resonances does not raise it, while the fitted noise model may have taken such an omission for noise.
    """

    def covariance(k: int, rest: Complex, through: Complex, few: WindowedSpectrum) -> Complex:
        del few
        return _floor_covariance(rest, through, levels(lines[k]))

    return _floor(fitted, lines, covariance)


def noise_floor(fitted: Fit, lines: list[WindowedSpectrum]) -> Floor:
    """Put a fit's residual on its own fitted noise: there the fit is at its optimum, and gains are a score test's."""

    def covariance(k: int, rest: Complex, through: Complex, few: WindowedSpectrum) -> Complex:
        del rest
        return fitted_noise(few, through, fitted.noises[k])

    return _floor(fitted, lines, covariance)


def _floor(
    fitted: Fit, lines: list[WindowedSpectrum], covariance: Callable[[int, Complex, Complex, WindowedSpectrum], Complex]
) -> Floor:
    """Put a residual on a floor; a long recording is thinned, and each line counts for as many as it stands for."""
    records = []
    size = fitted.hypothesis.size
    matrix, gradient = np.zeros((size, size)), np.zeros(size)
    belief = np.full(size, 1e-6)
    belief[: fitted.hypothesis.shape.size] = fitted.hypothesis.shape.belief
    for k, whole in enumerate(lines):
        one = whole.thinned(ENOUGH)
        stands_for = len(whole.frequencies) / len(one.frequencies)
        predicted = predict_lines(fitted.hypothesis, one)
        rest = one.measured - predicted.response
        through = through_structure(fitted.hypothesis, one)
        white = whitening(covariance(k, rest, through, one)) * np.sqrt(stands_for)
        stacked = whitened(white, jacobian(fitted.hypothesis, one, predicted))
        record = FloorRecord(one, rest, through, white, stacked, whitened(white, rest[:, :, None])[:, 0])
        records.append(record)
        matrix += 2 * stacked.T @ stacked
        gradient += 2 * stacked.T @ record.rest
    gradient[: fitted.hypothesis.shape.size] -= fitted.hypothesis.shape.belief * fitted.hypothesis.u
    return Floor(
        tuple(records), np.asarray(np.linalg.pinv(matrix + np.diag(belief), hermitian=True), dtype=float), gradient
    )


def _floor_covariance(rest: Complex, through: Complex, level: tuple[Real, Real]) -> Complex:
    bands = np.array_split(np.abs(rest) ** 2, min(150, max(4, len(rest) // 12)))
    # the fifth of bands that are quietest by chance alone is quieter than the noise
    count = float(np.mean([len(band) for band in bands]))
    quiet = (
        np.quantile(np.array([band.mean(axis=0) for band in bands]), 0.2, axis=0)
        * count
        / scipy.stats.gamma.ppf(0.2, count)
    )
    share = np.median(np.sqrt(quiet) / level[0])
    passed = through * (FORCE_SHARE * share * level[1])
    covariance = passed @ passed.conj().swapaxes(1, 2)
    diagonal = np.arange(rest.shape[1])
    covariance[:, diagonal, diagonal] += quiet
    return np.asarray(covariance)
