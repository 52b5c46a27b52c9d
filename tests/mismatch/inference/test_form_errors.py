"""What numbers owe to the form of a hypothesis, against closed forms."""

import numpy as np
import pytest

from millfrf.mismatch.inference.numerics import jackknife_variance, shift_weight


def test_the_jackknife_of_a_mean_is_its_variance() -> None:
    """``s^2 / n`` exactly (Efron & Tibshirani, section 11.2)."""
    data = np.random.default_rng(6).standard_normal((12, 3))
    left_out = np.array([np.delete(data, k, axis=0).mean(axis=0) for k in range(12)])
    np.testing.assert_allclose(jackknife_variance(left_out), data.var(axis=0, ddof=1) / 12, rtol=1e-12)


def test_the_jackknife_of_a_slope_covers_its_scatter() -> None:
    rng, line = np.random.default_rng(8), np.linspace(-1, 1, 40)
    slopes, variances = [], []
    for _ in range(400):
        data = 2 * line + rng.standard_normal(40)
        kept = [np.delete(np.arange(40), k) for k in range(40)]
        parts = np.array([[line[k] @ data[k] / (line[k] @ line[k])] for k in kept])
        slopes.append(line @ data / (line @ line))
        variances.append(jackknife_variance(parts)[0])
    assert np.mean(variances) == pytest.approx(np.var(slopes), rel=0.15)


def test_the_weight_of_a_shift_is_that_of_the_likelihood_ratio() -> None:
    """``1 - L0 / L1`` with ``L1 / L0 = exp(gain / 2)``: nothing without a gain, all with a large one."""
    for gain in (0.5, 2.0, 10.0):
        ratio = np.exp(gain / 2)
        assert shift_weight(gain) == pytest.approx((ratio - 1) / ratio)
    assert shift_weight(-3.0) == 0.0
    assert shift_weight(200.0) == pytest.approx(1.0)
