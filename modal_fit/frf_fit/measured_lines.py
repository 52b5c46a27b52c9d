"""`MeasuredLines`: the whitened lines of an FRF matrix, and the noise of its entries."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimation import FRF_ORDERS, Frf, window_correlation
from millfrf.core import Complex, Real

from ..models.out_of_band import basis_with_poles, fixed_pole, fixed_poles

_MANY = 60  # lines from which on three fixed poles stand for the modes outside, else one
_OUTLIER = float(np.log(30.0))  # an entry's noise power below what row and column say
_OUTLIER_ROUNDS = 20
_LEAST = 1e-3  # of the median over the lines: a variance below is an estimate of few averages


@dataclass(frozen=True)
class MeasuredLines:
    """Lines of ``H = s^d [sum_r right_r left_r^T / (s - p_r) + conjugate + out-of-band]``, weighted by their noise.

    The noise is white in the measured quantity, so that an accelerance stays one: converted to receptance, its noise
    would grow towards 0 Hz. A response's noise enters by ``whitening``, which is the same on all lines; because each
    response has its own right vectors, it changes nothing but the weights. What differs from line to line enters
    by ``weights``.

    Parameters
    ----------
    s : (n_lines,), rad/s
        Laplace variable of each line: 2 pi i f, moved to the right by the damping of an exponential window.
    factor : (n_lines,)
        Factor ``s^d``: 1 for a receptance, s for a mobility, s^2 for an accelerance.
    values : (n_lines, n_columns, n_responses)
        FRFs times ``drive``, weighted and whitened.
    drive : (n_lines, n_columns, n_excitations)
        Combination of excitations behind each column, weighted.
    whitening : (n_responses, n_responses)
        ``values = (H drive) whitening^T``.
    weights : (n_lines, n_columns)
        Weights of the amplitude; ``values`` and ``drive`` contain them.
    outside_poles : rad/s
        Fixed poles that stand for modes outside the band.
    basis : (n_terms, n_lines)
        Out-of-band functions on receptance.
    band : Hz
        Lowest and highest frequency of the fit.
    noise : (n_lines,)
        Noise power expected on each line, summed over columns and responses, in the units of ``values``.
    correlation
        Number of lines per independent value of the noise; above 1 under an exponential window.
    stated
        Whether the FRF came with a covariance; else the noise is that of neighbouring lines or of the coherence.
    """

    s: Complex
    factor: Complex
    values: Complex
    drive: Complex
    whitening: Real
    weights: Real
    outside_poles: tuple[complex, ...]
    basis: Complex
    band: tuple[float, float]
    noise: Real
    correlation: float = 1.0
    stated: bool = False

    @property
    def frequencies(self) -> Real:
        """Hz, shape (n_lines,)."""
        return np.asarray(self.s.imag / (2 * np.pi))

    @property
    def n_values(self) -> int:
        """Count of the real numbers that are fitted."""
        return 2 * self.values.size

    @property
    def spacing(self) -> float:
        """Typical distance of two lines, Hz."""
        return float(np.median(np.diff(self.frequencies)))

    def part(self, chosen: NDArray[np.bool_]) -> "MeasuredLines":
        """The lines for which ``chosen`` (n_lines,) is true."""
        return replace(
            self,
            s=self.s[chosen],
            factor=self.factor[chosen],
            values=self.values[chosen],
            drive=self.drive[chosen],
            weights=self.weights[chosen],
            basis=self.basis[:, chosen],
            noise=self.noise[chosen],
        )


def measured_lines(frf: Frf, chosen: NDArray[np.bool_], band: tuple[float, float], variance: Real) -> MeasuredLines:
    """Take lines of an FRF whose entries have independent noise, such as a hammer test's.

    Parameters
    ----------
    frf
        FRF to fit: receptance, mobility, accelerance or transfer.
    chosen : (n_frequencies,), bool
        Whether each line is taken.
    band : Hz
        Lowest and highest frequency of the fit.
    variance : (n_lines, n_responses, n_excitations)
        Noise power of each entry on each chosen line. The weights are its best split (by the means of the logarithm)
        into a factor a response and a factor a line and excitation.
    """
    logarithm = _without_outliers(np.log(np.maximum(variance, 1e-300)))
    per_response = np.exp(-0.5 * (logarithm.mean(axis=(0, 2)) - logarithm.mean()))
    weights = np.exp(-0.5 * logarithm.mean(axis=1))
    drive = np.eye(weights.shape[1]) * weights[:, :, None]
    noise = np.sum(variance.transpose(0, 2, 1) * weights[:, :, None] ** 2 * per_response**2, axis=(1, 2))
    return _assembled(frf, chosen, band, drive.astype(complex), np.diag(per_response), weights, noise)


def _without_outliers(logarithm: Real) -> Real:
    """Raise the noise of entries that have far less than their row and column: a dead entry must not weigh much."""
    for _ in range(_OUTLIER_ROUNDS):
        entries = logarithm.mean(axis=0)
        expected = entries.mean(axis=1, keepdims=True) + entries.mean(axis=0) - entries.mean()
        logarithm = logarithm + np.maximum(expected - _OUTLIER - entries, 0.0)
    return logarithm


def correlated_lines(frf: Frf, chosen: NDArray[np.bool_], band: tuple[float, float]) -> MeasuredLines:
    """Lines of an FRF with a covariance ``R (x) Q`` on each line, as stacked milling records give.

    The columns of ``H C`` with ``C^T Q conj(C) = I`` have covariance R each and none with one another. Of R,
    the real part of its mean over the lines is whitened; its level enters line by line.
    """
    assert frf.covariance is not None
    response, excitation = frf.covariance.response[chosen], frf.covariance.excitation[chosen]
    power = np.real(np.einsum("kpp->kp", response))
    power = np.maximum(power, _LEAST * np.median(power, axis=0))
    level = np.exp(np.mean(np.log(power), axis=1))
    level = np.maximum(_smoothed_of_whitened_lines(level), _LEAST * np.median(level))
    mean = np.mean(response.real / level[:, None, None], axis=0)
    mean = mean + 1e-6 * np.diag(np.diag(mean))
    whitening = np.asarray(np.linalg.inv(np.linalg.cholesky(mean)), dtype=np.float64)
    factor = np.linalg.cholesky(excitation.conj())
    drive = np.linalg.inv(factor) / np.sqrt(level)[:, None, None]
    weights = np.repeat(1 / np.sqrt(level)[:, None], drive.shape[1], axis=1)
    noise = np.full(len(level), float(np.prod(drive.shape[1:2]) * response.shape[1]))
    return replace(_assembled(frf, chosen, band, drive.conj(), whitening, weights, noise), stated=True)


def noise_correlation(frf: Frf, reach: int) -> Real:
    """Real part of the correlation of the noise on two lines by their distance, (2 reach + 1,), the middle one 1.

    An exponential window correlates white noise (:func:`estimation.window_correlation`); without one, lines are
    independent. Summed, it is the largest factor by which variances of functions of many lines grow.
    """
    apart = np.arange(-reach, reach + 1).astype(np.float64)
    if frf.exponential_time_constant is None:
        return np.asarray((apart == 0).astype(float))
    spacing = float(np.median(np.diff(frf.frequencies)))
    between = window_correlation(np.asarray(apart * spacing, dtype=np.float64), frf.exponential_time_constant)
    return np.asarray(between.real)


def _smoothed_of_whitened_lines(level: Real) -> Real:
    """Mean over nine neighbouring lines: a covariance of few averages scatters."""
    if len(level) < 9:
        return level
    padded = np.concatenate([level[3::-1], level, level[:-5:-1]])
    return np.asarray(np.convolve(padded, np.ones(9) / 9, "valid"))


def _assembled(
    frf: Frf,
    chosen: NDArray[np.bool_],
    band: tuple[float, float],
    drive: Complex,
    whitening: Real,
    weights: Real,
    noise: Real,
) -> MeasuredLines:
    s = frf.laplace[chosen]
    poles = fixed_poles(band) if len(s) >= _MANY else [fixed_pole(band)]
    values = np.einsum("kpq,kjq,up->kju", frf.values[chosen], drive, whitening, optimize=True)
    return MeasuredLines(
        s=s,
        factor=s ** FRF_ORDERS.get(frf.quantity, 0),
        values=np.ascontiguousarray(values),
        drive=np.ascontiguousarray(drive),
        whitening=whitening,
        weights=weights,
        outside_poles=tuple(poles),
        basis=basis_with_poles(s, band, poles),
        band=band,
        noise=np.asarray(noise),
        correlation=float(noise_correlation(frf, len(frf.frequencies)).sum()),
    )


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
    return np.where(known, np.maximum(_smoothed_of_noise_of_entries(stated), 1e-3 * np.median(stated, axis=0)), flat)


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


def _smoothed_of_noise_of_entries(variance: Real) -> Real:
    """Running mean over the lines, ends mirrored."""
    reach = min(_LINES // 2, len(variance) - 1)
    padded = np.concatenate([variance[reach:0:-1], variance, variance[-2 : -reach - 2 : -1]])
    summed = np.cumsum(np.concatenate([np.zeros((1, *variance.shape[1:])), padded]), axis=0)
    width = 2 * reach + 1
    return np.asarray((summed[width:] - summed[:-width]) / width)
