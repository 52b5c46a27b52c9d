"""The factor between motion quantities against the derivative of a sine; high-passes against their responses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from estimation import (
    BandRecording,
    before_force_high_pass,
    before_high_pass,
    channels_of,
    derivative_orders,
    kinematic_factor,
)

RATE = 1000.0


@pytest.mark.parametrize(("quantity", "order"), [("displacement", 0), ("velocity", 1), ("acceleration", 2)])
def test_the_factor_is_the_derivative_of_a_sine(quantity: str, order: int) -> None:
    """``x = sin(w t)``: its derivatives by numpy against the factor on its phasor."""
    frequency, time = 3.0, np.arange(4000) / 4000.0
    turn = 2 * np.pi * frequency
    moved = np.sin(turn * time)
    for _ in range(order):
        moved = np.gradient(moved, time, edge_order=2)
    factor = kinematic_factor(np.array([frequency]), derivative_orders(channels_of(quantity, ["T:+X"])), (0.0,))
    expected = np.imag(factor[0, 0] * np.exp(1j * turn * time))
    np.testing.assert_allclose(moved[10:-10], expected[10:-10], atol=1e-4 * turn**order)


def test_a_high_pass_is_that_of_its_differential_equation() -> None:
    """``y' + w_c y = x'`` integrated in time until it is steady, against the factor and its inverse."""
    corner, frequency = 2.0, 3.0
    turn, omega = 2 * np.pi * frequency, 2 * np.pi * corner
    solution = solve_ivp(
        lambda t, y: turn * np.cos(turn * t) - omega * y, (0, 3), [0.0], rtol=1e-9, atol=1e-11, dense_output=True
    )
    time = np.linspace(2, 3, 50)
    factor = kinematic_factor(np.array([frequency]), np.array([0]), (corner,))[0, 0]
    np.testing.assert_allclose(solution.sol(time)[0], np.imag(factor * np.exp(1j * turn * time)), atol=1e-6)
    inverse = before_high_pass(np.array([1j * turn]), (corner, 0.0))
    np.testing.assert_allclose(inverse, [[1 / factor, 1.0]], rtol=1e-12)


def test_nothing_is_undone_at_zero_frequency() -> None:
    """There nothing passed: neither on the imaginary axis nor beside it, as under an exponential window."""
    np.testing.assert_array_equal(before_high_pass(np.array([0j, 5.0 + 0j]), (1.0,)), 1.0)


def test_forces_before_a_high_pass() -> None:
    """A sine that a first-order high-pass turned and weakened comes back as it was, apart from a slow drift."""
    corner, frequency = 0.5, 5.0
    time = np.arange(20_000) / RATE
    shown = kinematic_factor(np.array([frequency]), np.array([0]), (corner,))[0, 0]
    force = np.imag(shown * np.exp(2j * np.pi * frequency * time))[:, None]
    channel = replace(channels_of("force", ["TCP:+X"])[0], high_pass_hz=corner)
    recording = BandRecording("t", RATE, force, np.zeros((len(time), 0)), (channel,), ())
    result = before_force_high_pass(recording)
    np.testing.assert_allclose(result.force[:, 0], np.sin(2 * np.pi * frequency * time), atol=2e-3)
    assert result.excitations[0].high_pass_hz is None
    assert np.abs(recording.force[:, 0] - np.sin(2 * np.pi * frequency * time)).max() > 0.05


def test_forces_without_a_high_pass_stay() -> None:
    recording = BandRecording("t", RATE, np.ones((10, 1)), np.ones((10, 0)), channels_of("force", ["TCP:+X"]), ())
    assert before_force_high_pass(recording) is recording
