"""The fit of a cut against a truth that is known, and against another solver."""

import numpy as np
import pytest
from scipy.optimize import least_squares
from small_cut import small_cut, stated

from millfrf.mismatch.cut.fitting import FreeNumbers, fit_cut

FREED = ("runout", "regenerative_feedback", "process_damping")
NUMBERS = {"runout": [12e-6], "regenerative_feedback": [1.0], "process_damping": [2e5]}
TRUTH = stated(np.array([0.4, -0.5, 0.3, 0.0, 0.0, 0.0]), **NUMBERS)


def test_without_noise_the_truth_is_found() -> None:
    """The noise is tiny, so that the belief in the coefficients does not pull."""
    fit = fit_cut(small_cut(TRUTH, noise=1e-5), stated(), FREED)
    np.testing.assert_allclose(fit.hypothesis.deviations, TRUTH.deviations, atol=1e-3)
    for name in FREED:
        np.testing.assert_allclose(fit.hypothesis.values(name), NUMBERS[name], rtol=1e-3)


def test_numbers_scatter_by_their_standard_errors() -> None:
    """Over seeds ``(estimate - truth) / error`` is standard normal: its square sums to chi-square."""
    scores = []
    for seed in range(12):
        fit = fit_cut(small_cut(TRUTH, noise=2.0, seed=seed), TRUTH, FREED)
        for name in FREED:
            off = fit.hypothesis.values(name) - np.array(NUMBERS[name])
            scores.append(off / np.sqrt(np.diag(fit.covariance_of(name))))
    total = float(np.sum(np.square(scores)))
    assert 17.9 < total < 61.6  # 99 % of chi-square with 36 degrees of freedom


def test_another_solver_finds_the_same_minimum() -> None:
    """A free share is negative by chance here: the bound at zero must hold."""
    cut = small_cut(stated(), noise=2.0, seed=5)
    fit = fit_cut(cut, stated(), ("regenerative_feedback", "process_damping"))
    free = FreeNumbers(cut, stated(), fit.freed, True)

    def residual(x: np.ndarray) -> np.ndarray:
        here = free.hypothesis(x)
        rest = np.sqrt(2) * cut.residual(0, here).ravel()
        return np.concatenate([rest.real, rest.imag, here.deviations])

    low, high = free.bounds
    inside = np.clip(free.begin, np.where(np.isfinite(low), low + 1e-3, -1e9), high)
    expected = least_squares(residual, inside, bounds=(low, high), diff_step=1e-4, x_scale=1.0)
    assert fit.cost == pytest.approx(2 * expected.cost, abs=0.2)


def test_score_and_blocks_add_up() -> None:
    cut = small_cut(TRUTH)
    half = fit_cut(cut, TRUTH, ("runout",), part=slice(0, None, 2))
    assert half.misfit == pytest.approx(half.block_misfits[0][::2].sum())
    assert half.price == pytest.approx(np.log(2 * cut.spectra[0].measured[::2].size))
    assert half.score == half.misfit + half.deviation + half.price
    assert half.deviation == pytest.approx(float(np.sum(half.hypothesis.deviations**2)))


def test_held_coefficients_stay_as_the_file_says() -> None:
    fit = fit_cut(small_cut(TRUTH), stated(), (), refit=False)
    assert fit.hypothesis.deviations.tolist() == [0.0] * 6
    assert fit.covariance.shape == (0, 0)
