"""Noise of force spectra, against noise that is put in."""

from dataclasses import replace

import numpy as np
import pytest
from small_cut import small_cut, stated

from millfrf.mismatch.cut.recordings import noise_of, whitened

SPECTRA = small_cut(stated()).spectra[0]


def _drawn(root: np.ndarray, seed: int = 1) -> np.ndarray:
    both = np.random.default_rng(seed).standard_normal((2, *SPECTRA.measured.shape))
    return np.asarray((both[0] + 1j * both[1]) / np.sqrt(2) @ root.T)


def test_floor_and_correlation_of_the_channels_are_found() -> None:
    covariance = np.array([[4.0, 1.5, 0.0], [1.5, 1.0, 0.0], [0.0, 0.0, 0.25]])
    residual = _drawn(np.linalg.cholesky(covariance))
    result = noise_of(SPECTRA, residual, np.zeros_like(residual), 0.0)
    assert result.floor.mean(axis=0) == pytest.approx(np.diag(covariance), rel=0.1)
    # lines above nine times the floor are left out, and 2 % of independence are added
    assert result.together[0, 1] == pytest.approx(0.75, abs=0.05)
    white = whitened(result, residual).reshape(-1, 3)
    np.testing.assert_allclose(white.T @ white.conj() / len(white), np.eye(3), atol=0.12)


def test_lines_of_an_order_do_not_raise_the_floor() -> None:
    residual = _drawn(np.eye(3))
    residual[:, 5] += 100.0
    clean = noise_of(SPECTRA, _drawn(np.eye(3)), np.zeros_like(residual), 0.0)
    assert noise_of(SPECTRA, residual, np.zeros_like(residual), 0.0).floor.max() < 1.3 * clean.floor.max()


def test_the_usual_error_of_a_force_weighs_as_once_in_the_mean_of_the_blocks() -> None:
    """``W`` of a line of size F: ``1 / (floor + B e^2 F^2)``."""
    residual = _drawn(np.eye(3))
    predicted = np.full_like(residual, 50.0)
    result = noise_of(SPECTRA, residual, predicted, 0.02)
    alone = replace(result, together=np.eye(3))
    expected = 1 / np.sqrt(result.floor[7, 0] + SPECTRA.blocks * (0.02 * 50.0) ** 2)
    assert alone.whitener[0, 7, 0, 0] == pytest.approx(expected, rel=1e-9)
