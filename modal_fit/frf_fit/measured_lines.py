"""`MeasuredLines`: the whitened lines of an FRF matrix, the noise of its entries, and the peaks of the response."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import FRF_ORDERS, Frf, window_correlation
from millfrf.core import Band, Complex, Real

from ..models.out_of_band import fixed_poles, out_of_band_basis
from ..settings import SETTINGS

_CUBIC_RESIDUAL = np.array([1.0, -4.0, 6.0, -4.0, 1.0])  # weights of five lines, zero on every cubic


@dataclass(frozen=True)
class MeasuredLines:
    """Lines of ``H = s^d [sum_r right_r left_r^T / (s - p_r) + conjugate + out-of-band]``, weighted by their noise.

    The noise is white in the measured quantity. An accelerance is therefore not converted to receptance, where its
    noise would grow towards 0 Hz. ``whitening`` describes the noise of the responses, the same on all lines; because
    right vectors are fitted response by response, it only changes the weights. ``weights`` describes how the noise
    differs from line to line.
    """

    s: Complex  # (n_lines,), rad/s: 2 pi i f, moved to the right by the damping of an exponential window
    factor: Complex  # (n_lines,): s^d, with d = 0 for a receptance, 1 for a mobility, 2 for an accelerance
    values: Complex  # (n_lines, n_columns, n_responses): FRFs times drive, weighted and whitened
    drive: Complex  # (n_lines, n_columns, n_excitations): weighted combination of excitations of each column
    whitening: Real  # (n_responses, n_responses): values = (H drive) whitening^T
    weights: Real  # (n_lines, n_columns): weights of the amplitude; values and drive contain them
    outer_poles: tuple[complex, ...]  # rad/s: fixed poles that represent modes outside the band
    basis: Complex  # (n_terms, n_lines): out-of-band functions on receptance
    band: Band
    noise: Real  # (n_lines,): expected noise power, summed over columns and responses, in the units of values
    correlation: float = 1.0  # number of lines per independent noise value; above 1 under an exponential window
    has_covariance: bool = False  # else the noise is estimated from neighbouring lines or the coherence

    @property
    def frequencies(self) -> Real:
        """Return the frequencies of the lines, Hz, shape (n_lines,)."""
        return np.asarray(self.s.imag / (2 * np.pi))

    @property
    def n_values(self) -> int:
        """Return the number of real numbers that are fitted."""
        return 2 * self.values.size

    @property
    def spacing(self) -> float:
        """Return the median distance of neighbouring lines, Hz."""
        return float(np.median(np.diff(self.frequencies)))

    @property
    def entries(self) -> Complex:
        """Return the FRF matrix without weights, transposed: (n_lines, n_excitations, n_responses)."""
        return np.asarray(np.linalg.solve(self.drive, self.values) @ np.linalg.inv(self.whitening).T)

    def subset(self, chosen: NDArray[np.bool_]) -> "MeasuredLines":
        """Return the lines for which ``chosen`` (n_lines,) is true."""
        per_line = ("s", "factor", "values", "drive", "weights", "noise")
        return replace(self, basis=self.basis[:, chosen], **{name: getattr(self, name)[chosen] for name in per_line})

    def with_fixed_poles(self, below: Sequence[float], above: Sequence[float]) -> "MeasuredLines":
        """Return the lines with fixed poles at these multiples of the lower and upper edge of the band."""
        poles = fixed_poles(self.band, below, above)
        return replace(self, outer_poles=tuple(poles), basis=out_of_band_basis(self.s, self.band, poles))


def measured_lines(frf: Frf, chosen: NDArray[np.bool_], band: Band, variance: Real) -> MeasuredLines:
    """Take lines of an FRF whose entries have independent noise, as in a hammer test.

    Parameters
    ----------
    frf
        Receptance, mobility, accelerance or transfer.
    chosen : (n_frequencies,), bool
        Whether each line is taken.
    band : Hz
        Lowest and highest frequency of the fit.
    variance : (n_lines, n_responses, n_excitations)
        Noise power of each entry on each chosen line. It is split (by means of the logarithm) into one factor for each
        response and one for each line and excitation, which give the weights.
    """
    logarithm = _without_outliers(np.log(np.maximum(variance, 1e-300)))
    per_response = np.exp(-0.5 * (logarithm.mean(axis=(0, 2)) - logarithm.mean()))
    weights = np.exp(-0.5 * logarithm.mean(axis=1))
    drive = np.eye(weights.shape[1]) * weights[:, :, None]
    noise = np.sum(variance.transpose(0, 2, 1) * weights[:, :, None] ** 2 * per_response**2, axis=(1, 2))
    return _assembled(frf, chosen, band, drive.astype(complex), np.diag(per_response), weights, noise)


def _without_outliers(logarithm: Real) -> Real:
    """Raise the noise of entries far below the mean of their row and column: a dead entry must get no large weight."""
    for _ in range(20):
        entries = logarithm.mean(axis=0)
        expected = entries.mean(axis=1, keepdims=True) + entries.mean(axis=0) - entries.mean()
        logarithm = logarithm + np.maximum(expected - SETTINGS.noise_outlier - entries, 0.0)
    return logarithm


def correlated_lines(frf: Frf, chosen: NDArray[np.bool_], band: Band) -> MeasuredLines:
    """Take lines of an FRF with a covariance ``R (x) Q`` on each line, as a fit of stacked milling records gives.

    The columns of ``H C`` with ``C^T Q conj(C) = I`` are independent, each with the covariance R. The real part of the
    mean of R over the lines is whitened; the level of R weights each line.
    """
    assert frf.covariance is not None
    response, excitation = frf.covariance.response[chosen], frf.covariance.excitation[chosen]
    least = SETTINGS.least_noise  # a variance far below the median is an estimate from few averages
    power = np.real(np.einsum("kpp->kp", response))
    power = np.maximum(power, least * np.median(power, axis=0))
    level = np.exp(np.mean(np.log(power), axis=1))
    level = np.maximum(_mean_of_nine(level), least * np.median(level))
    mean = np.mean(response.real / level[:, None, None], axis=0)
    mean = mean + 1e-6 * np.diag(np.diag(mean))  # regular where responses are dependent
    whitening = np.asarray(np.linalg.inv(np.linalg.cholesky(mean)), dtype=np.float64)
    factor = np.linalg.cholesky(excitation.conj())
    drive = np.linalg.inv(factor) / np.sqrt(level)[:, None, None]
    weights = np.repeat(1 / np.sqrt(level)[:, None], drive.shape[1], axis=1)
    noise = np.full(len(level), float(drive.shape[1] * response.shape[1]))
    return replace(_assembled(frf, chosen, band, drive.conj(), whitening, weights, noise), has_covariance=True)


def _mean_of_nine(level: Real) -> Real:
    """Return the mean over nine neighbouring lines, because a covariance from few averages scatters."""
    if len(level) < 9:
        return level
    return np.asarray(np.convolve(np.pad(level, 4, "symmetric"), np.ones(9) / 9, "valid"))


def noise_correlation(frf: Frf, reach: int) -> Real:
    """Return the real part of the correlation of the noise on two lines over their distance, shape (2 reach + 1,).

    The middle value is 1. An exponential window correlates white noise (:func:`estimation.window_correlation`); without
    it, lines are independent. The sum of the correlation is the largest factor by which variances of functions of many
    lines grow.
    """
    apart = np.arange(-reach, reach + 1).astype(np.float64)
    if frf.exponential_time_constant is None:
        return np.asarray((apart == 0).astype(float))
    spacing = float(np.median(np.diff(frf.frequencies)))
    correlation = window_correlation(np.asarray(apart * spacing, dtype=np.float64), frf.exponential_time_constant)
    return np.asarray(correlation.real)


def _assembled(
    frf: Frf,
    chosen: NDArray[np.bool_],
    band: Band,
    drive: Complex,
    whitening: Real,
    weights: Real,
    noise: Real,
) -> MeasuredLines:
    s = frf.laplace[chosen]
    poles = fixed_poles(band) if len(s) >= SETTINGS.lines_for_three_poles else fixed_poles(band, (), (2.0,))
    values = np.einsum("kpq,kjq,up->kju", frf.values[chosen], drive, whitening, optimize=True)
    return MeasuredLines(
        s=s,
        factor=s ** FRF_ORDERS.get(frf.quantity, 0),
        values=np.ascontiguousarray(values),
        drive=np.ascontiguousarray(drive),
        whitening=whitening,
        weights=weights,
        outer_poles=tuple(poles),
        basis=out_of_band_basis(s, band, poles),
        band=band,
        noise=np.asarray(noise),
        correlation=float(noise_correlation(frf, len(frf.frequencies)).sum()),
    )


def entry_noise(frf: Frf, chosen: NDArray[np.bool_]) -> Real:
    """Return the noise variance ``E|dH[p, q]|^2`` on the chosen lines, shape (n_lines, n_responses, n_excitations).

    Where the FRF has a noise estimate (covariance, or coherence and averages), it is smoothed over neighbouring lines;
    other entries get :func:`neighbour_noise`.
    """
    values = frf.values[chosen]
    neighbours = neighbour_noise(values) / _cubic_residual_share(frf)
    variance = frf.entry_variance()
    if variance is None:
        return neighbours
    variance = variance[chosen]
    known = np.isfinite(variance).all(axis=0) & (variance.max(axis=0) > 0)
    return np.where(known, np.maximum(_running_mean(variance), 1e-3 * np.median(variance, axis=0)), neighbours)


def _cubic_residual_share(frf: Frf) -> float:
    """Return the share of the noise that remains in the residual of a cubic through five lines.

    It is below 1 under an exponential window.
    """
    n = len(_CUBIC_RESIDUAL)
    correlation = noise_correlation(frf, n - 1)
    apart = np.subtract.outer(np.arange(n), np.arange(n))
    share = _CUBIC_RESIDUAL @ correlation[apart + n - 1] @ _CUBIC_RESIDUAL / np.sum(_CUBIC_RESIDUAL**2)
    return float(share)


def neighbour_noise(values: Complex) -> Real:
    """Estimate the variance of noise that is white over neighbouring lines, from a cubic through five of them.

    ``|x_(k-2) - 4 x_(k-1) + 6 x_k - 4 x_(k+1) + x_(k+2)|^2`` has 70 times the noise's variance. Resonances are narrow
    and hardly change its median over a block of lines; the median of an exponentially distributed power is ln 2 of the
    mean. Between the middles of blocks the logarithm is interpolated, because the noise of a tap test rises where the
    hammer excites little and, in a receptance, towards 0 Hz. A window that correlates neighbouring lines makes the
    result too small. ``values`` and the result are (n_lines, n_responses, n_excitations).

    >>> rng = np.random.default_rng(0)
    >>> noise = rng.standard_normal((2, 4000, 1, 1)) @ np.array([[0.5]])
    >>> curve = np.linspace(-1, 1, 4000)[:, None, None] ** 3
    >>> float(np.median(neighbour_noise(curve + noise[0] + 1j * noise[1])).round(1))
    0.5
    """
    n = len(values) - len(_CUBIC_RESIDUAL) + 1
    power = np.mean(np.abs(values) ** 2, axis=0)
    if n < 1:
        return np.asarray(np.broadcast_to(1e-6 * power, values.shape))
    residual = sum(weight * values[k : k + n] for k, weight in enumerate(_CUBIC_RESIDUAL))
    blocks = np.array_split(np.arange(n), max(1, n // SETTINGS.noise_block))
    level = np.array([np.median(np.abs(residual[block]) ** 2, axis=0) for block in blocks])
    level = np.maximum(level / (np.log(2) * np.sum(_CUBIC_RESIDUAL**2)), 1e-20 * power + 1e-300)  # floor: rounding
    middles = np.array([block.mean() for block in blocks]) + len(_CUBIC_RESIDUAL) // 2
    return _interpolated(np.log(level), middles, len(values))


def _interpolated(logarithm: Real, middles: Real, n_lines: int) -> Real:
    """Interpolate logarithms (n_blocks, ...) at the lines ``middles`` to all lines; return the exponentials."""
    flat = logarithm.reshape(len(middles), -1)
    lines = np.arange(n_lines)
    curves = np.stack([np.interp(lines, middles, column) for column in flat.T], axis=1)
    return np.asarray(np.exp(curves.reshape(n_lines, *logarithm.shape[1:])))


def _running_mean(variance: Real) -> Real:
    """Return the running mean over fifteen lines with mirrored ends, because a variance from few averages scatters."""
    reach = min(7, len(variance) - 1)
    padded = np.pad(variance, ((reach, reach), (0, 0), (0, 0)), "reflect")
    summed = np.cumsum(np.concatenate([np.zeros((1, *variance.shape[1:])), padded]), axis=0)
    width = 2 * reach + 1
    return np.asarray((summed[width:] - summed[:-width]) / width)


def lines_around(frequency: float, damping_ratio: float, lines: MeasuredLines) -> NDArray[np.bool_]:
    """Return which lines lie within six half bandwidths of a pole, widened to as many lines as the unknowns need."""
    axis = lines.frequencies
    half = max(SETTINGS.neighbourhood_width * damping_ratio * frequency, 0.5 * SETTINGS.fewest_around * lines.spacing)
    needed = min(len(axis), max(SETTINGS.fewest_around, SETTINGS.lines_per_term * len(lines.basis)))
    chosen = np.abs(axis - frequency) <= half
    while chosen.sum() < needed:
        half *= 1.3
        chosen = np.abs(axis - frequency) <= half
    return np.asarray(chosen)


def half_power_lines(pole: complex, lines: MeasuredLines) -> NDArray[np.bool_]:
    """Return which lines lie inside the half-power band of a pole; the five nearest where the band is narrower."""
    frequency, damping_ratio = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
    half = max(damping_ratio * frequency, 2.5 * lines.spacing)
    return np.asarray(np.abs(lines.frequencies - frequency) <= half)


def peak_rise(pole: complex, own: NDArray[np.bool_], lines: MeasuredLines) -> float:
    """Return the response at the peak of a pole over that in the dips on both sides of it, as a ratio of amplitudes.

    The response is the root of the power summed over all entries of the FRF matrix, in their unit. Each dip is the
    least response between the peak and a higher one, or the end of the lines, on that side. The result is 1 where the
    pole has no peak; three standard errors of the noise are deducted.

    Parameters
    ----------
    pole : rad/s
        Pole whose peak is looked for, within its half-power band.
    own : (n_lines,), bool
        Lines whose peak belongs to this pole and to no other mode.
    lines
        Lines of the FRF matrix.
    """
    width = int(np.clip(SETTINGS.peak_smoothing * -pole.real / (2 * np.pi) / lines.spacing, 1, len(lines.s)))
    weighted = np.sum(np.abs(lines.values) ** 2, axis=(1, 2))
    summed = np.sum(np.abs(lines.entries) ** 2, axis=(1, 2))
    power, noise = _smoothed(summed, width), _smoothed(lines.noise * summed / np.maximum(weighted, 1e-300), width)
    top = np.zeros(len(power), dtype=bool)
    top[1:-1] = (power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])
    maxima = np.flatnonzero(top & own & half_power_lines(pole, lines))
    prominences = scipy.signal.peak_prominences(power, maxima)[0]
    sure = power[maxima] - 3 * np.sqrt(2 * power[maxima] * noise[maxima] / width)
    dip = np.maximum(power[maxima] - prominences, np.maximum(noise[maxima], 1e-300))
    return float(np.sqrt(np.maximum(sure, 0.0) / dip).max(initial=1.0))


def _smoothed(power: Real, width: int) -> Real:
    """Return the running mean over ``width`` lines; the window is shorter at the ends."""
    summed = np.concatenate([[0.0], np.cumsum(power)])
    first = np.maximum(np.arange(len(power)) - (width - 1) // 2, 0)
    last = np.minimum(np.arange(len(power)) + width // 2 + 1, len(power))
    return np.asarray((summed[last] - summed[first]) / (last - first))
