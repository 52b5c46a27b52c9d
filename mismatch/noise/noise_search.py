"""The variances of noise under which the lines of narrow bands are likeliest, by Newton's method."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .noise_loops import lump_lines, noise_likelihood

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

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
