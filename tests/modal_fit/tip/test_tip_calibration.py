"""Calibration to the tip where tip or sensor hardly move in a direction: what rests stays at rest."""

import numpy as np
import pytest

from estimation import Frf, FrfCovariance
from modal_fit import ModalModel, calibrate_to_tip
from modal_fit.tip.mapping import real_matrix, sensor_to_tip, shapes_at_tip

TIP = ("TCP:+X", "TCP:+Y", "TCP:+Z")
SENSOR = ("HOUSING:+X", "HOUSING:+Y", "HOUSING:+Z")

SHAPES_AT_TIP = np.array([[0.02, 0.09, 0.0], [0.16, -0.03, 0.0]])
SHAPES_AT_SENSOR = np.array([[0.01, 0.08, 0.0], [0.07, -0.01, -0.03]])
"""kg^-1/2. Both modes leave the tip's Z at rest; the second turns the sensor about it, the first does not."""

FREQUENCIES, RATIOS = np.array([18.0, 30.0]), np.array([0.03, 0.03])
LINES = np.arange(8.0, 60.0, 0.125)


def _model(shapes: np.ndarray, responses: tuple[str, ...]) -> ModalModel:
    natural = 2 * np.pi * FREQUENCIES
    damped = natural * np.sqrt(1 - RATIOS**2)
    left = SHAPES_AT_TIP / (2j * damped[:, None])
    return ModalModel(-RATIOS * natural + 1j * damped, shapes.astype(complex), left, responses, TIP)


def _tapped(shapes: np.ndarray, responses: tuple[str, ...], noise: float, rng: np.random.Generator) -> Frf:
    exact = _model(shapes, responses).receptance(LINES)
    size = noise * np.abs(exact).max()
    values = exact + size / np.sqrt(2) * (rng.standard_normal(exact.shape) + 1j * rng.standard_normal(exact.shape))
    ones = np.ones(len(LINES))[:, None, None]
    covariance = FrfCovariance(size**2 * ones * np.eye(3) + 0j, ones * np.eye(3) + 0j)
    return Frf(LINES, values, responses, TIP, "receptance", "m/N", LINES > 0, covariance=covariance)


def _calibrated(noise: float, seed: int) -> ModalModel:
    rng = np.random.default_rng(seed)
    own = _model(SHAPES_AT_SENSOR, SENSOR)
    tip, sensor = _tapped(SHAPES_AT_TIP, TIP, noise, rng), _tapped(SHAPES_AT_SENSOR, SENSOR, noise, rng)
    known = np.zeros((2 * (own.poles.size + own.right.size + own.left.size),) * 2)
    return calibrate_to_tip(
        ModalModel(own.poles, own.right, own.left, SENSOR, TIP, covariance=known), tip, sensor
    ).model


@pytest.mark.parametrize("seed", range(3))
def test_a_tip_that_rests_is_not_moved_by_a_sensor_that_turns(seed: int) -> None:
    result = _calibrated(2e-3, seed)
    assert np.abs(result.right - SHAPES_AT_TIP).max() < 0.02 * np.abs(SHAPES_AT_TIP).max()


@pytest.mark.long
def test_error_bars_hold_where_the_sensor_hardly_moves_and_where_the_tip_rests() -> None:
    scores = []
    for seed in range(12):
        result = _calibrated(2e-3, seed)
        assert result.covariance is not None
        start, size = 2 * len(result.poles), result.right.size
        errors = np.sqrt(np.diag(result.covariance)[start : start + size]).reshape(result.right.shape)
        scores.append((result.right.real - SHAPES_AT_TIP) / errors)
    size = np.sqrt(np.mean(np.square(scores), axis=0))
    assert (size > 0.4).all()
    assert (size < 1.8).all()


def test_the_real_matrix_carries_shapes_as_the_maps_do() -> None:
    rng = np.random.default_rng(0)
    tip, sensor, shapes = rng.standard_normal((3, 4, 3)) + 1j * rng.standard_normal((3, 4, 3))
    maps = sensor_to_tip(tip, sensor, rng.random((4, 3)) < 0.5)
    moved = shapes_at_tip(maps, shapes).ravel()
    packed = real_matrix(maps) @ np.concatenate([shapes.real.ravel(), shapes.imag.ravel()])
    assert np.allclose(packed, np.concatenate([moved.real, moved.imag]))


def test_the_shapes_of_the_hammer_test_themselves_are_carried_to_its_tip() -> None:
    rng = np.random.default_rng(1)
    tip, sensor = rng.standard_normal((2, 4, 3)) + 1j * rng.standard_normal((2, 4, 3))
    for replaced in (np.zeros((4, 3), dtype=bool), np.ones((4, 3), dtype=bool), rng.random((4, 3)) < 0.5):
        assert np.allclose(shapes_at_tip(sensor_to_tip(tip, sensor, replaced), 2j * sensor), 2j * tip)
