"""Residual cells regressed on the prediction: against a general solver, and shares that move recovered."""

import numpy as np
import pytest
from scipy.optimize import nnls

from millfrf.mismatch.structure.structured_residual import explained_power


def _plain(rest: np.ndarray, shown: np.ndarray, bins: int) -> float:
    """The same regression with SciPy's non-negative least squares."""
    moving, together = 0.0, shown.mean(axis=0)
    for start in range(0, len(rest), bins):
        cells, same = rest[start : start + bins], shown[start : start + bins]
        broad = np.broadcast_to(together, cells.shape)
        columns = np.stack([np.ones(cells.size), same.ravel() / same.mean(), broad.ravel() / broad.mean()], axis=1)
        weight, factors = np.full(cells.size, 1 / cells.mean()), np.zeros(3)
        for _ in range(3):
            factors = nnls(columns * weight[:, None], cells.ravel() * weight)[0]
            weight = 1 / np.maximum(columns @ factors, 0.1 * cells.mean())
        moving += cells.size * float(factors[1] + factors[2])
    return moving


@pytest.mark.parametrize("scale", [1.0, 1e-12])
@pytest.mark.parametrize("bins", [12, 7])
def test_regression_is_that_of_a_general_solver(scale: float, bins: int) -> None:
    rng = np.random.default_rng(4)
    shown = rng.exponential(size=(40, 30)) * rng.exponential(size=(1, 30))
    rest = scale * (rng.exponential(size=(40, 30)) + 0.3 * shown + 0.2 * shown.mean(axis=0))
    assert explained_power(rest, shown, bins) == pytest.approx(_plain(rest, shown, bins), rel=1e-8)


def test_shares_that_move_are_recovered() -> None:
    """Noise of power one beside 0.5 of the signal's power in the same cell: a third moves."""
    rng = np.random.default_rng(5)
    shown = rng.exponential(size=(600, 80)) * rng.uniform(0.1, 2, size=(1, 80))
    shown /= shown.mean()
    rest = (1.0 + 0.5 * shown) * rng.exponential(size=(600, 80))
    assert explained_power(rest, shown, 12) / rest.sum() == pytest.approx(1 / 3, abs=0.03)
