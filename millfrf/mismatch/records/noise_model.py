"""Noise of responses and forces, inferred from the residual of a model."""

from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, Real

from .noise_loops import average_bands, line_covariances, noise_likelihood, whiten_lines, whitened_squares

KNOTS = 4  # knots of each response's noise spectrum over ln frequency

LEAST_BANDS = 12  # least number of bands for each knot, if there are so many lines

SIGNAL_ERROR = 2e-3  # error proportional to the signal, as a share of it: sensors are rarely more linear; a choice


@dataclass(frozen=True)
class NarrowBands:
    """Means of residual lines over narrow bands."""

    counts: Real  # number of lines, (n_bands,)
    sample: Complex  # covariance of the residual, (n_bands, n, n)
    unit_noise: Complex  # covariance of the responses to unit noise of each force, (n_bands, n_excitations, n, n)
    hats: Real  # weights that interpolate from the knots, (n_bands, n_knots)
    known: Real  # known variance of each response, (n_bands, n)


def narrow_bands(residual: Complex, through: Complex, weights: Real, hat: Real, known: Real) -> NarrowBands:
    """Average residual lines (n_lines, n) over narrow bands.

    ``through``: matrix from forces to responses, (n_lines, n, n_excitations). ``weights``: of each line, 1 or less.
    ``hat``: weights that interpolate from the knots, (n_lines, n_knots). ``known``: known variance of each response,
    (n_lines, n).
    """
    count, n = residual.shape
    # 12 lines a band, but enough bands for the knots of a short recording, and at most 150
    n_bands = min(150, max(min(count, LEAST_BANDS * KNOTS), count // 12))
    edges = np.unique(np.linspace(0, count, n_bands + 1).astype(np.int64))
    counts = np.diff(edges).astype(float)
    sample = np.empty((len(counts), n, n), dtype=complex)
    unit_noise = np.empty((len(counts), through.shape[2], n, n), dtype=complex)
    average_bands(edges, np.ascontiguousarray(residual), weights, np.ascontiguousarray(through), sample, unit_noise)
    hats, variances = (np.add.reduceat(values, edges[:-1], axis=0) / counts[:, None] for values in (hat, known))
    return NarrowBands(counts, sample, unit_noise, hats, variances)


def cost_of(x: Real, bands: NarrowBands, prior: tuple[Real, Real]) -> tuple[float, Real, Real]:
    """Return the negative log posterior, its gradient and its Hessian.

    ``x``: logarithms of the noise variances: those of each response at the knots, then those of the forces, (n *
    n_knots + n_excitations,). ``prior``: matrix A and vector b of the weak prior ``0.5 |A x + b|^2``.
    """
    n, knots = bands.sample.shape[1], bands.hats.shape[1]
    m, n_bands, size = len(x) - n * knots, len(bands.counts), n * knots
    # the bounds keep exp finite when a trial step is far off
    own = np.exp(np.clip(bands.hats @ x[:size].reshape(n, knots).T, -80, 80))
    forces = np.exp(np.clip(x[size:], -80, 80))
    by_own, by_force = np.empty((n_bands, n)), np.empty(m)
    parts = np.empty((n_bands, n, n)), np.empty((n_bands, n, m)), np.empty((m, m))
    arrays = bands.counts, bands.sample, bands.unit_noise, bands.known
    cost = noise_likelihood(arrays, own, forces, (by_own, by_force), parts)
    gradient = np.concatenate([(by_own.T @ bands.hats).ravel(), by_force])
    hats, hessian = bands.hats, np.empty((len(x), len(x)))
    pairs = (hats[:, :, None] * hats[:, None, :]).reshape(n_bands, -1)
    blocks = (parts[0].reshape(n_bands, -1).T @ pairs).reshape(n, n, knots, knots)
    mixed = (parts[1].reshape(n_bands, -1).T @ hats).reshape(n, m, knots)
    hessian[:size, :size] = blocks.transpose(0, 2, 1, 3).reshape(size, size)
    hessian[:size, size:] = mixed.transpose(0, 2, 1).reshape(size, m)
    hessian[size:, :size] = hessian[:size, size:].T
    hessian[size:, size:] = parts[2]
    slope, offset = prior
    off = slope @ x + offset
    return cost + 0.5 * float(off @ off), gradient + slope.T @ off, hessian + slope.T @ slope


def most_likely(start: Real, bands: NarrowBands, prior: tuple[Real, Real], steps: int) -> Real:
    """Minimise `cost_of` by at most ``steps`` Newton steps, which avoid saddles and are shortened if the cost rises."""
    widest = 3.0  # largest change of ln variance in a step
    x = start
    cost, gradient, hessian = cost_of(x, bands, prior)
    reach = widest
    for _ in range(steps):
        curvatures, directions = np.linalg.eigh(hessian)
        # absolute values turn a saddle into descent; 0.05 is about the curvature of the prior alone
        step = -directions @ ((directions.T @ gradient) / np.maximum(np.abs(curvatures), 0.05))
        if not -gradient @ step > 1e-4:  # expected gain in ln likelihood
            break
        longest = float(np.abs(step).max())
        step *= min(1.0, reach / longest)
        trial = cost_of(x + step, bands, prior)
        if not trial[0] < cost:
            reach = min(reach, longest) / 4
            continue
        reach = min(2 * reach, widest)
        x, (cost, gradient, hessian) = x + step, trial
    return x


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of the residual lines of one recording, ``V(f) = diag(c(f) + e(f)) + G(f) diag(v) G(f)^H``.

    c is the noise variance of the responses, v the noise variance of the measured forces, and G the matrix from forces
    to responses. The variance e of an error proportional to the signal is known.
    """

    knots: Real  # logarithms of the frequencies between which ln c is interpolated, (KNOTS,), ln Hz
    responses: Real  # logarithm of each response's noise variance c at the knots, (n_responses, KNOTS)
    forces: Real  # logarithm of each force's noise variance v, (n_excitations,)
    # largest mean variance of each response over the lines, (n_responses,): noise beyond it is scaled down; None: no
    # bound is known
    most: Real | None = None

    def covariance(self, frequencies: Real, through: Complex, inexact: Real | None = None) -> Complex:
        """Return V (n_lines, n_responses, n_responses) at frequencies (n_lines,), Hz.

        ``through`` (n_lines, n_responses, n_excitations) is G, ``inexact`` (n_lines, n_responses) is e.
        """
        own = np.exp(_hat(self.knots, frequencies) @ self.responses.T)
        if inexact is not None:
            own += inexact
        result = np.empty((*own.shape, own.shape[1]), dtype=complex)
        line_covariances(own, np.ascontiguousarray(through), np.exp(self.forces), result)
        if self.most is not None:
            mean = np.einsum("kpp->p", result).real / len(result)
            factor = np.sqrt(np.minimum(1.0, self.most / np.maximum(mean, 1e-300)))
            result *= np.outer(factor, factor)
        return result

    def sizes(self, frequencies: Real, residual: Complex, through: Complex, inexact: Real | None = None) -> Real:
        """Return the whitened squares ``r^H V^-1 r`` (n_lines,) of residual lines r (n_lines, n_responses)."""
        squares = np.empty(len(residual))
        white = whitening_and_determinant(self.covariance(frequencies, through, inexact))[0]
        whitened_squares(white, np.ascontiguousarray(residual), squares)
        return squares

    def response_level(self) -> Real:
        """Return the root mean square noise of each response over the band's knots, (n_responses,)."""
        return np.asarray(np.sqrt(np.exp(self.responses).mean(axis=1)))


def flat_noise(frequencies: Real, responses: Real, n_excitations: int) -> NoiseModel:
    """Return the noise with the same variance (n_responses,) at every line and no noise of the forces."""
    knots = np.linspace(np.log(frequencies[0]), np.log(frequencies[-1]), KNOTS)
    level = np.tile(np.log(np.maximum(responses, 1e-30))[:, None], KNOTS)
    return NoiseModel(knots, level, np.full(n_excitations, -80.0))


def quiet_noise(noise: NoiseModel, residual: Complex) -> NoiseModel:
    """Return flat noise of the level of the quietest fifth of narrow bands, and no noise of the forces.

    An effect that is missing in a model shows at resonances and hardly raises this level. ``residual``: (n_lines,
    n_responses).
    """
    bands = np.array_split(np.abs(residual) ** 2, min(150, max(4, len(residual) // 12)))
    level = np.log(np.quantile([band.mean(axis=0) for band in bands], 0.2, axis=0))
    return replace(noise, responses=0 * noise.responses + level[:, None], forces=0 * noise.forces - 200.0)


def inexactness(measured: Complex) -> Real:
    """Return the variance of the error proportional to the signal, ``(SIGNAL_ERROR |y|)^2``, (n_lines, n_responses).

    At constant speed a few lines contain all information and are a thousand times larger than noise. Without this
    error, any cause that fits these lines with the precision of the noise would be accepted.
    """
    return np.asarray(SIGNAL_ERROR**2 * (measured.real**2 + measured.imag**2))


def whitening(covariance: Complex) -> Complex:
    """Return the lower triangular W (n_lines, n, n) with ``W^H W = V^-1``, for which W r is white.

    Raises ``numpy.linalg.LinAlgError`` if the covariance V of a line is not positive definite.
    """
    return whitening_and_determinant(covariance)[0]


def whitening_and_determinant(covariance: Complex) -> tuple[Complex, float]:
    """Return W as `whitening` does, and the sum of ``ln det V`` over the lines."""
    white = np.array(covariance, dtype=complex, order="C")
    total = whiten_lines(white)
    if not np.isfinite(total):
        raise np.linalg.LinAlgError("the covariance of a line is not positive definite")
    return white, total


def fit_noise(
    frequencies: Real,
    residual: Complex,
    through: Complex,
    levels: tuple[Real, Real],
    start: NoiseModel | None = None,
    forces: Real | None = None,
    inexact: Real | None = None,
) -> NoiseModel:
    """Fit the most likely noise to Gaussian residual lines, with smaller weights on outliers.

    Maximises ``-sum ln det V + r^H V^-1 r`` over narrow bands by Newton's method (Whittle's likelihood). ``through``:
    matrix G from forces to responses, (n_lines, n_responses, n_excitations). ``levels``: root mean square of the
    responses (n_responses,) and forces (n_excitations,), which scale the weak prior. ``start``: first estimate; None
    takes it from the residual. ``forces``: measured noise variance of the forces, which is not estimated then.
    ``inexact``: known variance of the error proportional to the signal, (n_lines, n_responses).
    """
    knots = np.linspace(np.log(frequencies[0]), np.log(frequencies[-1]), KNOTS)
    n, m = residual.shape[1], through.shape[2]
    turns, steps = (1, 12) if start is not None else (2, 60)
    if start is None:
        # the squares of Gaussian noise are exponential, with the median ln 2 times the mean
        level = np.log(np.maximum(np.median(np.abs(residual) ** 2, axis=0) / np.log(2), 1e-30))
        share = np.mean(level - 2 * np.log(levels[0]))
        start = NoiseModel(knots, np.tile(level[:, None], KNOTS) - 1.0, share - 2.0 + 2 * np.log(levels[1]))
    hat = _hat(knots, frequencies)
    weights = np.ones(len(frequencies))
    log_forces = None if forces is None else np.log(np.maximum(forces, 1e-30))
    if log_forces is not None:
        start = replace(start, forces=log_forces)
    prior = _prior(n, m, levels, log_forces)
    known = np.zeros(residual.shape) if inexact is None else inexact
    noise = start
    for turn in range(turns):
        if turn:
            # lines far above their expected square n are no Gaussian noise
            squares = noise.sizes(frequencies, residual, through, inexact)
            weights = np.minimum(1.0, (4.0 * n + 6.0) / np.maximum(squares, 1e-12))
        bands = narrow_bands(residual, through, weights, hat, known)
        best = most_likely(np.concatenate([noise.responses.ravel(), noise.forces]), bands, prior, steps)
        noise = NoiseModel(knots, best[: n * KNOTS].reshape(n, KNOTS), best[n * KNOTS :])
    return noise


def _hat(knots: Real, frequencies: Real) -> Real:
    """Return the weights of linear interpolation between the knots in ln f, (n, KNOTS)."""
    place = np.clip((np.log(frequencies) - knots[0]) / (knots[1] - knots[0]), 0, len(knots) - 1.0)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(len(knots)))))


def _prior(n: int, m: int, levels: tuple[Real, Real], log_forces: Real | None) -> tuple[Real, Real]:
    """Return A and b of the prior ``0.5 |A x + b|^2`` of all ln variances; strong for forces that are held."""
    size = n * KNOTS + m
    # neighbouring knots differ by about 1 in ln variance: noise has a smooth spectrum, resonances have not
    smooth = np.zeros((n * (KNOTS - 1), size))
    for row in range(len(smooth)):
        first = row // (KNOTS - 1) * KNOTS + row % (KNOTS - 1)
        smooth[row, first : first + 2] = -1.0, 1.0
    offset = np.zeros(len(smooth))
    share = np.zeros((m, size))
    if log_forces is not None:
        deviation = 1e-3  # of the ln variance
        share[np.arange(m), n * KNOTS + np.arange(m)] = 1 / deviation
        return np.vstack([smooth, share]), np.concatenate([offset, -log_forces / deviation])
    # ln(force noise share / response noise share) is -0.7 +- 1: forces are measured at least as well
    share[:, : n * KNOTS] = -0.5 / (n * KNOTS)
    share[np.arange(m), n * KNOTS + np.arange(m)] = 0.5
    ratio = np.log(levels[0]).mean() - np.log(levels[1]) + 0.7
    return np.vstack([smooth, share]), np.concatenate([offset, ratio])
