"""Noise of responses and forces, inferred from what a model leaves over: no share, colour or silent band is assumed."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from .line_loops import noise_likelihood, whiten_lines

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

KNOTS = 4
"""Of each response's noise spectrum over log frequency."""

STIFFNESS = 1.0
"""Standard deviation of ln variance between neighbouring knots: colour is smooth, resonances are not colour."""

FORCE_SHARE = (-0.7, 1.0)
"""Mean and standard deviation of ln(force noise share / response noise share): forces are measured no worse."""


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of one trial's residual lines, ``V(f) = diag c(f) + G(f) diag(v) G(f)^H``.

    G carries the noise of the measured forces through the structure to the responses.

    Parameters
    ----------
    knots : (KNOTS,), ln Hz
    responses : (n_responses, KNOTS)
        ln of the responses' noise variance a line at the knots.
    forces : (n_excitations,)
        ln of the forces' noise variance a line.
    """

    knots: Real
    responses: Real
    forces: Real

    def covariance(self, frequencies: Real, through: Complex) -> Complex:
        """V at lines, (n_lines, n_responses, n_responses); ``through`` is G, (n_lines, n_responses, n_excitations)."""
        own = np.exp(_hat(self.knots, frequencies) @ self.responses.T)
        passed = through * np.exp(0.5 * self.forces)
        result = passed @ passed.conj().swapaxes(1, 2)
        diagonal = np.arange(own.shape[1])
        result[:, diagonal, diagonal] += own + 1e-12 * np.trace(result, axis1=1, axis2=2).real[:, None]
        return np.asarray(result)

    def response_level(self) -> Real:
        """Root mean square noise of each response over the band's knots, (n_responses,)."""
        return np.asarray(np.sqrt(np.exp(self.responses).mean(axis=1)))


def whitening(covariance: Complex) -> Complex:
    """W with ``W^H W = V^-1``, so that W r is white, (n_lines, n, n), lower triangular.

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
    frequencies: Real, residual: Complex, through: Complex, levels: tuple[Real, Real], start: NoiseModel | None = None
) -> NoiseModel:
    """Most likely noise of residual lines that are Gaussian, outlying lines weighted down.

    Maximises ``-sum ln det V + r^H V^-1 r`` over narrow bands with analytic gradient (Whittle's likelihood).

    Parameters
    ----------
    frequencies : (n_lines,), Hz
    residual : (n_lines, n_responses)
    through : (n_lines, n_responses, n_excitations)
    levels
        Root mean square a line of responses (n_responses,) and forces (n_excitations,): the scale of the weak prior.
    start
        To begin with.
    """
    knots = np.linspace(np.log(frequencies[0]), np.log(frequencies[-1]), KNOTS)
    n, m = residual.shape[1], through.shape[2]
    warm = start is not None
    if start is None:
        level = np.log(np.maximum(np.median(np.abs(residual) ** 2, axis=0) / np.log(2), 1e-30))
        share = np.mean(level - 2 * np.log(levels[0]))
        start = NoiseModel(knots, np.tile(level[:, None], KNOTS) - 1.0, share - 2.0 + 2 * np.log(levels[1]))
    bands = _bands(len(frequencies))
    weights = np.ones(len(frequencies))
    noise = start
    for _ in range(1 if warm else 2):
        lumps = _lumped(frequencies, residual, through, weights, bands, knots)
        first = np.concatenate([noise.responses.ravel(), noise.forces])
        answer = minimize(
            _cost, first, (lumps, n, m, levels), jac=True, method="L-BFGS-B", options={"maxiter": 12 if warm else 150}
        )
        noise = NoiseModel(knots, answer.x[: n * KNOTS].reshape(n, KNOTS), answer.x[n * KNOTS :])
        white = whitening(noise.covariance(frequencies, through))
        size = np.sum(np.abs(np.einsum("kij,kj->ki", white, residual)) ** 2, axis=1)
        weights = np.minimum(1.0, (4.0 * n + 6.0) / np.maximum(size, 1e-12))
    return noise


@dataclass(frozen=True)
class _Lumps:
    counts: Real
    covariance: Complex
    through: Complex
    hats: Real


def _hat(knots: Real, frequencies: Real) -> Real:
    """Linear interpolation between knots in ln f, (n, KNOTS)."""
    place = np.clip((np.log(frequencies) - knots[0]) / (knots[1] - knots[0]), 0, len(knots) - 1.0)
    return np.asarray(np.maximum(0.0, 1.0 - np.abs(place[:, None] - np.arange(len(knots)))))


def _bands(count: int) -> list[slice]:
    """Some 150 narrow bands of lines."""
    edges = np.unique(np.linspace(0, count, min(150, max(2, count // 12)) + 1).astype(int))
    return [slice(int(a), int(b)) for a, b in pairwise(edges)]


def _lumped(
    frequencies: Real, residual: Complex, through: Complex, weights: Real, bands: list[slice], knots: Real
) -> _Lumps:
    counts, covariances, passed, hats = [], [], [], []
    hat = _hat(knots, frequencies)
    for band in bands:
        r = residual[band]
        counts.append(float(len(r)))
        covariances.append((r * weights[band, None]).T @ r.conj() / len(r))
        passed.append(np.einsum("kiq,kjq->qij", through[band], through[band].conj()) / len(r))
        hats.append(hat[band].mean(axis=0))
    return _Lumps(np.array(counts), np.array(covariances), np.array(passed), np.array(hats))


def _cost(x: Real, lumps: _Lumps, n: int, m: int, levels: tuple[Real, Real]) -> tuple[float, Real]:
    """Negative log likelihood with the weak priors, and its gradient."""
    responses, forces = x[: n * KNOTS].reshape(n, KNOTS), x[n * KNOTS :]
    own = np.exp(np.clip(lumps.hats @ responses.T, -80, 80))
    pushed = np.exp(np.clip(forces, -80, 80))
    by_own, gradient_force = np.empty_like(own), np.empty(m)
    cost = noise_likelihood(lumps.counts, lumps.covariance, lumps.through, own, pushed, by_own, gradient_force)
    gradient_own = by_own.T @ lumps.hats
    steps = np.diff(responses, axis=1) / STIFFNESS
    cost += 0.5 * np.sum(steps**2)
    gradient_own[:, 1:] += steps / STIFFNESS
    gradient_own[:, :-1] -= steps / STIFFNESS
    share = np.mean(responses, axis=1).mean() - 2 * np.log(levels[0]).mean()
    off = (0.5 * (forces - 2 * np.log(levels[1]) - share) - FORCE_SHARE[0]) / FORCE_SHARE[1]
    cost += 0.5 * np.sum(off**2)
    gradient_force += 0.5 * off / FORCE_SHARE[1]
    gradient_own -= 0.5 * off.sum() / FORCE_SHARE[1] / responses.size
    return float(cost), np.concatenate([gradient_own.ravel(), gradient_force])
