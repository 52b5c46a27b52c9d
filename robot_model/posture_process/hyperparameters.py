"""Amplitudes and length of the process: their priors, their best values, and draws that say how far they are known."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from .posture_kernels import SquaredDistances
from .process_covariance import PARTS, covariance_parts
from .process_rows import Rows

Real = NDArray[np.float64]

NAMES = (*PARTS, "length")

MEDIANS = np.array([0.15, 0.05, 0.07, 0.008, 0.004, 0.06, 0.04, 0.35, 0.2, 0.12, 0.06, 0.9])
"""Medians of the priors: what robots' models are off by before anything is measured, shares; and the length scale."""

FACTORS = np.array([2.0, 2.2, 2.0, 2.5, 2.5, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 1.7])
"""Factors of one standard deviation about the medians: with few postures the priors decide."""

DRAWS = 24
"""Draws of the hyperparameters."""

FREEDOM = 5.0
"""Degrees of freedom of the t distribution from which draws are proposed."""


@dataclass(frozen=True)
class Evidence:
    """Measured rows and distances of their postures: what the marginal likelihood is computed from."""

    rows: Rows
    distances: SquaredDistances


def covariance_of(hyper: Real, evidence: Evidence) -> Real:
    """Covariance of the measured rows with their noise, (n, n); ``hyper``: logarithms in the order of ``NAMES``."""
    parts = covariance_parts(evidence.rows, evidence.rows, evidence.distances, float(np.exp(hyper[-1])), True)
    return np.asarray(np.tensordot(np.exp(2 * hyper[:-1]), parts, 1) + np.diag(evidence.rows.noise**2))


def log_posterior(hyper: Real, evidence: Evidence) -> tuple[float, Real]:
    """Logarithm of marginal likelihood times prior, and its gradient, at logarithms of the hyperparameters.

    ``-(r^T A^-1 r + log det A) / 2 - sum ((h - log median) / log factor)^2 / 2`` (Rasmussen & Williams 2006, Eqs. 2.30
    and 5.9).
    """
    rows, step = evidence.rows, 1e-4
    parts = covariance_parts(rows, rows, evidence.distances, float(np.exp(hyper[-1])), True)
    squares = np.exp(2 * hyper[:-1])
    whole = np.tensordot(squares, parts, 1) + np.diag(rows.noise**2)
    factor = cho_factor(whole, lower=True)
    pulled = cho_solve(factor, rows.value)
    pull = np.outer(pulled, pulled) - cho_solve(factor, np.eye(len(rows)))
    longer = covariance_parts(rows, rows, evidence.distances, float(np.exp(hyper[-1] + step)), True)
    slopes = np.append(
        squares * np.tensordot(parts, pull, 2), np.sum(np.tensordot(squares, longer - parts, 1) * pull) / (2 * step)
    )
    away = (hyper - np.log(MEDIANS)) / np.log(FACTORS)
    logarithm = -0.5 * float(rows.value @ pulled) - float(np.sum(np.log(np.diag(factor[0])))) - 0.5 * float(away @ away)
    return logarithm, slopes - away / np.log(FACTORS)


def best_hyperparameters(evidence: Evidence, start: Real, fixed: Sequence[int] = ()) -> Real:
    """Logarithms of the hyperparameters at the largest posterior.

    Parameters
    ----------
    evidence
        Measured rows and the distances of their postures.
    start : (n_hyperparameters,)
        Logarithms to begin with.
    fixed
        Numbers of those that keep their start.
    """

    def negative(hyper: Real) -> tuple[float, Real]:
        value, slope = log_posterior(hyper, evidence)
        return -value, -slope

    spans = [
        (m - 3.5 * f, m + 3.5 * f) for m, f in zip(np.log(MEDIANS).tolist(), np.log(FACTORS).tolist(), strict=True)
    ]
    for k in fixed:
        spans[k] = (float(start[k]), float(start[k]))
    found = minimize(negative, start, jac=True, method="L-BFGS-B", bounds=spans, options={"maxiter": 60})
    return np.asarray(found.x)


def drawn_hyperparameters(
    evidence: Evidence, best: Real, seed: int = 0, count: int = DRAWS, fixed: Sequence[int] = ()
) -> Real:
    """Draws of the logarithms, (count, n_hyperparameters): few postures do not tell amplitudes to a point.

    Draws of a t distribution about the best values, with the curvature there, are weighed by the posterior over their
    density and drawn again (sampling, importance resampling: Rubin 1988).

    Parameters
    ----------
    evidence
        Measured rows and the distances of their postures.
    best : (n_hyperparameters,)
        Logarithms at the largest posterior.
    seed
        Seed of the generator that draws.
    count
        Number of draws.
    fixed
        Numbers of those that keep their best value.
    """
    size, rng = len(best), np.random.default_rng(seed)
    step = 0.05
    slopes = [
        (log_posterior(best + step * one, evidence)[1] - log_posterior(best - step * one, evidence)[1]) / (2 * step)
        for one in np.eye(size)
    ]
    curvature = -(np.array(slopes) + np.array(slopes).T) / 2
    values, vectors = np.linalg.eigh(curvature)
    spread = vectors / np.sqrt(np.maximum(values, 0.3 / np.log(FACTORS).max() ** 2))
    spread[list(fixed)] = 0.0
    tried = 6 * count
    wide = np.sqrt(FREEDOM / rng.chisquare(FREEDOM, tried))
    normal = rng.normal(size=(tried, size))
    proposed = best + wide[:, None] * (normal @ spread.T)
    heights = np.array([log_posterior(one, evidence)[0] for one in proposed])
    density = -(FREEDOM + size) / 2 * np.log1p(np.sum((wide[:, None] * normal) ** 2, axis=1) / FREEDOM)
    weights = np.exp(heights - density - (heights - density).max())
    weights = np.minimum(weights, weights.sum() / count * 1.5)  # no single draw may stand for all
    chosen = rng.choice(tried, count, p=weights / weights.sum())
    return np.asarray(proposed[np.sort(chosen)])
