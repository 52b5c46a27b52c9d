"""Noise of responses and forces, inferred from the residual of a model."""

from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, Real

from .loops import line_covariances, lump_lines, noise_likelihood, size_of_white, whiten_lines

MOST_BANDS, LEAST_LINES = 150, 12
"""Number of narrow bands at most into which lines are lumped, and lines in a band where there are few lines."""

SETTLED = 1e-4
"""Gain expected of a step, in ln likelihood, below which the search ends."""

FLATTEST = 0.05
"""Least curvature that a step trusts; the prior's is about as small."""

WIDEST = 3.0
"""Largest change of a ln variance in a step."""


@dataclass(frozen=True)
class Lumps:
    """Lines in narrow bands.

    Parameters
    ----------
    counts : (n_bands,)
        Number of lines in each band.
    sample : (n_bands, n, n)
        Covariance of the residual in each band.
    through : (n_bands, n_excitations, n, n)
        Covariance that unit noise of each force leaves in the responses.
    hats : (n_bands, n_knots)
        Weights that interpolate from the knots to each band.
    known : (n_bands, n)
        Variance of each response in each band that is known beforehand.
    """

    counts: Real
    sample: Complex
    through: Complex
    hats: Real
    known: Real


def lumped(residual: Complex, through: Complex, weights: Real, hat: Real, known: Real) -> Lumps:
    """Lines in narrow bands.

    Parameters
    ----------
    residual : (n_lines, n)
        Residual lines of the responses.
    through : (n_lines, n, n_excitations)
        Matrix from forces to responses at each line.
    weights : (n_lines,)
        Weight of each line, 1 or less.
    hat : (n_lines, n_knots)
        Weights that interpolate from the knots to each line.
    known : (n_lines, n)
        Variance of each response that is known beforehand.
    """
    count, n = residual.shape
    bands = min(MOST_BANDS, max(2, count // LEAST_LINES))
    edges = np.unique(np.linspace(0, count, bands + 1).astype(np.int64))
    counts = np.diff(edges).astype(float)
    sample = np.empty((len(counts), n, n), dtype=complex)
    passed = np.empty((len(counts), through.shape[2], n, n), dtype=complex)
    lump_lines(edges, np.ascontiguousarray(residual), weights, np.ascontiguousarray(through), sample, passed)
    hats, sure = (np.add.reduceat(one, edges[:-1], axis=0) / counts[:, None] for one in (hat, known))
    return Lumps(counts, sample, passed, hats, sure)


def cost_of(x: Real, lumps: Lumps, belief: tuple[Real, Real]) -> tuple[float, Real, Real]:
    """Negative log likelihood with the weak prior, its gradient, and its curvature.

    Parameters
    ----------
    x : (n * n_knots + n_excitations,)
        Logarithms of the noise variances: those of each response at the knots, then those of the forces.
    lumps
        Residual lines lumped in narrow bands.
    belief
        Matrix A and vector b of the prior ``0.5 |A x + b|^2``.
    """
    n, knots = lumps.sample.shape[1], lumps.hats.shape[1]
    m, bands = len(x) - n * knots, len(lumps.counts)
    own = np.exp(np.clip(lumps.hats @ x[: n * knots].reshape(n, knots).T, -80, 80))
    pushed = np.exp(np.clip(x[n * knots :], -80, 80))
    by_own, by_force = np.empty((bands, n)), np.empty(m)
    parts = np.empty((bands, n, n)), np.empty((bands, n, m)), np.empty((m, m))
    bands_of = lumps.counts, lumps.sample, lumps.through, lumps.known
    cost = noise_likelihood(bands_of, own, pushed, (by_own, by_force), parts)
    gradient = np.concatenate([(by_own.T @ lumps.hats).ravel(), by_force])
    curvature = np.empty((len(x), len(x)))
    hats = lumps.hats
    pairs = (hats[:, :, None] * hats[:, None, :]).reshape(bands, -1)
    blocks = (parts[0].reshape(bands, -1).T @ pairs).reshape(n, n, knots, knots)
    mixed = (parts[1].reshape(bands, -1).T @ hats).reshape(n, m, knots)
    curvature[: n * knots, : n * knots] = blocks.transpose(0, 2, 1, 3).reshape(n * knots, n * knots)
    curvature[: n * knots, n * knots :] = mixed.transpose(0, 2, 1).reshape(n * knots, m)
    curvature[n * knots :, : n * knots] = curvature[: n * knots, n * knots :].T
    curvature[n * knots :, n * knots :] = parts[2]
    slope, offset = belief
    off = slope @ x + offset
    return cost + 0.5 * float(off @ off), gradient + slope.T @ off, curvature + slope.T @ slope


def most_likely(first: Real, lumps: Lumps, belief: tuple[Real, Real], steps: int) -> Real:
    """Where Newton's steps from ``first`` end, so many at most; away from saddles, and shortened until they gain."""
    x = first
    cost, gradient, curvature = cost_of(x, lumps, belief)
    reach = WIDEST
    for _ in range(steps):
        bends, along = np.linalg.eigh(curvature)
        step = -along @ ((along.T @ gradient) / np.maximum(np.abs(bends), FLATTEST))
        if not -gradient @ step > SETTLED:
            break
        longest = float(np.abs(step).max())
        step *= min(1.0, reach / longest)
        then = cost_of(x + step, lumps, belief)
        if not then[0] < cost:
            reach = min(reach, longest) / 4
            continue
        reach = min(2 * reach, WIDEST)
        x, (cost, gradient, curvature) = x + step, then
    return x


KNOTS = 4
"""Number of knots of each response's noise spectrum over log frequency."""

STIFFNESS = 1.0
"""Standard deviation of ln variance between neighbouring knots: colour is smooth, resonances are not colour."""

FORCE_SHARE = (-0.7, 1.0)
"""Mean and standard deviation of ln(force noise share / response noise share): forces are measured no worse."""

HELD = 1e-3
"""Standard deviation of the ln variance of a force's noise that was measured."""

EXACT = 2e-3
"""Share of a response that no measurement and no simulation is exact to: sensors are rarely as linear. Chosen."""

WARM, COLD = 12, 60
"""Steps at most if the search begins with a noise that was fitted before, and if it begins with none."""


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of one trial's residual lines, ``V(f) = diag(c(f) + e(f)) + G(f) diag(v) G(f)^H``.

    G carries the noise of the measured forces through the structure to the responses; e is the error that goes with the
    signal, which is known.

    Parameters
    ----------
    knots : (KNOTS,), ln Hz
        Logarithms of the frequencies between which the noise spectrum is interpolated.
    responses : (n_responses, KNOTS)
        Logarithm of each response's noise variance at a line, at the knots.
    forces : (n_excitations,)
        Logarithm of each force's noise variance at a line.
    """

    knots: Real
    responses: Real
    forces: Real

    def covariance(self, frequencies: Real, through: Complex, inexact: Real | None = None) -> Complex:
        """Covariance V at lines, (n_lines, n_responses, n_responses).

        Parameters
        ----------
        frequencies : (n_lines,), Hz
            Frequencies of the lines.
        through : (n_lines, n_responses, n_excitations)
            Matrix G from forces to responses at the lines.
        inexact : (n_lines, n_responses)
            Variance of what goes with the signal itself, from :func:`inexactness`; None: none.
        """
        own = np.exp(_hat(self.knots, frequencies) @ self.responses.T)
        if inexact is not None:
            own += inexact
        result = np.empty((*own.shape, own.shape[1]), dtype=complex)
        line_covariances(own, np.ascontiguousarray(through), np.exp(self.forces), result)
        return result

    def sizes(self, frequencies: Real, residual: Complex, through: Complex, inexact: Real | None = None) -> Real:
        """Whitened squares ``r^H V^-1 r`` of residual lines (n_lines, n_responses), (n_lines,)."""
        sizes = np.empty(len(residual))
        white = whitening_and_determinant(self.covariance(frequencies, through, inexact))[0]
        size_of_white(white, np.ascontiguousarray(residual), sizes)
        return sizes

    def response_level(self) -> Real:
        """Root mean square noise of each response over the band's knots, (n_responses,)."""
        return np.asarray(np.sqrt(np.exp(self.responses).mean(axis=1)))


def flat_noise(frequencies: Real, responses: Real, n_excitations: int) -> NoiseModel:
    """Noise of the same variance at every line, (n_responses,), and none of the forces.

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines, rising.
    responses : (n_responses,)
        Variance of each response's noise at a line.
    n_excitations
        Number of forces.
    """
    knots = np.linspace(np.log(frequencies[0]), np.log(frequencies[-1]), KNOTS)
    level = np.tile(np.log(np.maximum(responses, 1e-30))[:, None], KNOTS)
    return NoiseModel(knots, level, np.full(n_excitations, -80.0))


def inexactness(measured: Complex) -> Real:
    """Variance of the error that goes with the signal, ``(EXACT |y|)^2`` of each line (n_lines, n_responses).

    Where a few lines hold all that is known, as at a constant speed, they stand a thousand times above the noise.
    Without this error the likelihood asks a model to follow them to the noise, and takes whatever makes it.
    """
    return np.asarray(EXACT**2 * (measured.real**2 + measured.imag**2))


def whitening(covariance: Complex) -> Complex:
    """The W with ``W^H W = V^-1`` for which W r is white, (n_lines, n, n), lower triangular.

    Raises
    ------
    numpy.linalg.LinAlgError
        A line's V is not positive definite.
    """
    return whitening_and_determinant(covariance)[0]


def whitening_and_determinant(covariance: Complex) -> tuple[Complex, float]:
    """W of :func:`whitening`, and ``sum ln det V`` over lines."""
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
    """Most likely noise of residual lines that are Gaussian, outlying lines weighted down.

    Maximises ``-sum ln det V + r^H V^-1 r`` over narrow bands by Newton's method (Whittle's likelihood).

    Parameters
    ----------
    frequencies : (n_lines,), Hz
        Frequencies of the lines, rising.
    residual : (n_lines, n_responses)
        Residual lines, measured minus predicted.
    through : (n_lines, n_responses, n_excitations)
        Matrix G from forces to responses at the lines.
    levels
        Root mean square over the lines of responses (n_responses,) and forces (n_excitations,): the scale of the weak
        prior.
    start
        Noise that the search begins with; None: taken from the residual.
    forces : (n_excitations,)
        Variance of the forces' noise at a line where it was measured, which is then held; None: estimated.
    inexact : (n_lines, n_responses)
        Variance of what goes with the signal, which is known; None: none.
    """
    knots = np.linspace(np.log(frequencies[0]), np.log(frequencies[-1]), KNOTS)
    n, m = residual.shape[1], through.shape[2]
    warm = start is not None
    if start is None:
        level = np.log(np.maximum(np.median(np.abs(residual) ** 2, axis=0) / np.log(2), 1e-30))
        share = np.mean(level - 2 * np.log(levels[0]))
        start = NoiseModel(knots, np.tile(level[:, None], KNOTS) - 1.0, share - 2.0 + 2 * np.log(levels[1]))
    hat = _hat(knots, frequencies)
    weights = np.ones(len(frequencies))
    held = None if forces is None else np.log(np.maximum(forces, 1e-30))
    if held is not None:
        start = replace(start, forces=held)
    belief = _belief(n, m, levels, held)
    known = np.zeros(residual.shape) if inexact is None else inexact
    noise = start
    for turn in range(1 if warm else 2):
        if turn:
            weights = np.minimum(
                1.0, (4.0 * n + 6.0) / np.maximum(noise.sizes(frequencies, residual, through, inexact), 1e-12)
            )
        lumps = lumped(residual, through, weights, hat, known)
        first = np.concatenate([noise.responses.ravel(), noise.forces])
        best = most_likely(first, lumps, belief, WARM if warm else COLD)
        noise = NoiseModel(knots, best[: n * KNOTS].reshape(n, KNOTS), best[n * KNOTS :])
    return noise


def _hat(knots: Real, frequencies: Real) -> Real:
    """Linear interpolation between knots in ln f, (n, KNOTS)."""
    place = np.clip((np.log(frequencies) - knots[0]) / (knots[1] - knots[0]), 0, len(knots) - 1.0)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(len(knots)))))


def _belief(n: int, m: int, levels: tuple[Real, Real], held: Real | None) -> tuple[Real, Real]:
    """Weak prior ``0.5 |A x + b|^2`` of the knots' ln variances and the forces', strong where they are held: A, b."""
    size = n * KNOTS + m
    smooth = np.zeros((n * (KNOTS - 1), size))
    for row in range(len(smooth)):
        first = row // (KNOTS - 1) * KNOTS + row % (KNOTS - 1)
        smooth[row, first : first + 2] = -1 / STIFFNESS, 1 / STIFFNESS
    share = np.zeros((m, size))
    if held is not None:
        share[np.arange(m), n * KNOTS + np.arange(m)] = 1 / HELD
        return np.vstack([smooth, share]), np.concatenate([np.zeros(len(smooth)), -held / HELD])
    share[:, : n * KNOTS] = -0.5 / (n * KNOTS)
    share[np.arange(m), n * KNOTS + np.arange(m)] = 0.5
    off = np.log(levels[0]).mean() - np.log(levels[1]) - FORCE_SHARE[0]
    return np.vstack([smooth, share / FORCE_SHARE[1]]), np.concatenate([np.zeros(len(smooth)), off / FORCE_SHARE[1]])
