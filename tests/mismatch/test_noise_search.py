"""Likelihood of noise: against NumPy, its derivatives against differences, its optimum against a general search."""

import numpy as np
import pytest
from scipy.optimize import minimize

from millfrf.mismatch.records.noise_loops import line_covariances, noise_likelihood
from millfrf.mismatch.records.noise_model import NarrowBands, cost_of, most_likely, narrow_bands

N, M, KNOTS = 2, 2, 4


@pytest.fixture
def lumps() -> NarrowBands:
    """Residuals of two responses with noise of their own and of two forces, and omissions at some lines."""
    rng = np.random.default_rng(2)
    place = np.linspace(0, KNOTS - 1, 600)
    hat = np.maximum(0.0, 1 - np.abs(place[:, None] - np.arange(KNOTS)))
    through = rng.normal(size=(600, N, M)) + 1j * rng.normal(size=(600, N, M))
    noise = [rng.normal(size=(600, k)) + 1j * rng.normal(size=(600, k)) for k in (N, M)]
    rest = noise[0] * [0.5, 2.0] + np.einsum("kpq,kq->kp", through, noise[1] * 0.7)
    rest[200:220] *= 30
    return narrow_bands(rest, through, np.ones(600), hat, 0.3 * np.abs(rest) ** 2)


@pytest.fixture
def belief() -> tuple[np.ndarray, np.ndarray]:
    """A weak prior."""
    return 0.3 * np.eye(N * KNOTS + M), np.full(N * KNOTS + M, 0.1)


def test_likelihood_of_noise_is_gaussian() -> None:
    """Against NumPy's determinant and inverse."""
    rng = np.random.default_rng(6)
    root = rng.normal(size=(3, 2, 2, 2)) + 1j * rng.normal(size=(3, 2, 2, 2))
    sample, through = root[:, 0] @ root[:, 0].conj().swapaxes(1, 2), root @ root.conj().swapaxes(2, 3)
    counts, own, pushed = np.array([4.0, 9.0, 2.0]), rng.uniform(0.5, 2, (3, 2)), np.array([0.3, 0.8])
    known = rng.uniform(0, 1, (3, 2))
    slopes = np.empty((3, 2)), np.empty(2)
    cost = noise_likelihood(
        (counts, sample, through, known),
        own,
        pushed,
        slopes,
        (np.empty((3, 2, 2)), np.empty((3, 2, 2)), np.empty((2, 2))),
    )
    covariance = np.einsum("q,bqij->bij", pushed, through) + (own + known)[:, :, None] * np.eye(2)
    traces = np.trace(np.linalg.solve(covariance, sample), axis1=1, axis2=2).real
    assert cost == pytest.approx(float(counts @ (np.linalg.slogdet(covariance)[1] + traces)), rel=1e-10)


def test_covariance_of_lines() -> None:
    rng = np.random.default_rng(3)
    own, pushed = rng.uniform(0.5, 2, (5, 3)), np.array([0.4, 2.0])
    through = rng.normal(size=(5, 3, 2)) + 1j * rng.normal(size=(5, 3, 2))
    result = np.empty((5, 3, 3), dtype=complex)
    line_covariances(own, through, pushed, result)
    plain = np.einsum("kiq,q,kjq->kij", through, pushed, through.conj()) + own[:, :, None] * np.eye(3)
    np.testing.assert_allclose(result, plain, atol=1e-9)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_slopes_and_curvature(lumps: NarrowBands, belief: tuple[np.ndarray, np.ndarray], seed: int) -> None:
    """Gradient against differences of the cost, curvature against differences of the gradient."""
    x = np.random.default_rng(seed).normal(size=N * KNOTS + M)
    _, gradient, curvature = cost_of(x, lumps, belief)
    for k in range(len(x)):
        aside = np.zeros(len(x))
        aside[k] = 1e-5
        up, down = cost_of(x + aside, lumps, belief), cost_of(x - aside, lumps, belief)
        assert gradient[k] == pytest.approx((up[0] - down[0]) / 2e-5, rel=1e-5, abs=1e-4)
        np.testing.assert_allclose(curvature[k], (up[1] - down[1]) / 2e-5, rtol=1e-4, atol=1e-2)


@pytest.mark.parametrize("start", [-4.0, 0.0, 6.0])
def test_the_search_ends_where_a_general_one_does(
    lumps: NarrowBands, belief: tuple[np.ndarray, np.ndarray], start: float
) -> None:
    """SciPy's BFGS from the best of many starts is the oracle; ours starts far off."""

    def plain(x: np.ndarray) -> tuple[float, np.ndarray]:
        return cost_of(x, lumps, belief)[:2]

    rng = np.random.default_rng(7)
    oracle = min(
        (minimize(plain, rng.normal(size=N * KNOTS + M), jac=True, method="L-BFGS-B") for _ in range(8)),
        key=lambda one: float(one.fun),
    )
    result = most_likely(np.full(N * KNOTS + M, start), lumps, belief, 60)
    assert cost_of(result, lumps, belief)[0] <= oracle.fun + 1e-3
