"""Solvers with the periodic coefficients kept: converged benchmark limits, published cuts, and one another."""

from dataclasses import replace
from math import acos, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cutting import MillingProcess, directional_matrix
from foundation import InputError
from modal_fit import ModalModel
from replay_data import table_one_model
from stability import collocation, delay_system, multi_frequency, multipliers, semi_discretisation, zero_order
from stability.multi_frequency import directional_harmonics
from stability.semi_discretisation import mean_directional_matrices, one_period_multipliers

RPM = pi / 30
HALF_DOWN = MillingProcess(2, 0.0127, pi / 2, 119e6, 0.17, 0.33, pi / 2, pi, 0.15e-3)
SPEEDS = np.array([6000, 8000, 10000, 15000, 20000, 25000]) * RPM


def one_mode() -> ModalModel:
    omega, zeta, mass = 2 * pi * 922, 0.011, 0.03993
    damped = omega * np.sqrt(1 - zeta**2)
    pole = -zeta * omega + 1j * damped
    return ModalModel(
        np.array([pole]), np.array([[1 + 0j]]), np.array([[1 / (2j * mass * damped)]]), ("TCP:+X",), ("TCP:+X",)
    )


def immersed(share: float, side: str) -> MillingProcess:
    start, exit_angle = 0.0, pi
    if side == "up":
        exit_angle = acos(1 - 2 * share)
    if side == "down":
        start = acos(2 * share - 1)
    return MillingProcess(2, 0.01, pi / 2, 6e8, 1 / 3, 0.0, start, exit_angle, 1e-4)


def test_semi_discretisation_converges_with_the_square_of_the_step_to_the_same_radius() -> None:
    """Slot, 20000 rpm, 2 mm: the published first-order figures for 40, 80, 160 steps, and their limit 1.17807."""
    cut = immersed(1.0, "slot")
    states = delay_system(one_mode(), cut)
    radii = []
    for steps in (40, 80, 160):
        stiffness = 6e8 * 2e-3 * mean_directional_matrices(cut, steps)
        radii.append(np.abs(one_period_multipliers(states, stiffness, 60 / (2 * 20000), 1)).max())
    np.testing.assert_allclose(radii, [1.17618, 1.17761, 1.17796], atol=2e-4)
    errors = np.abs(np.array(radii) - 1.1780746993923594)
    assert np.log2(errors[:-1] / errors[1:]) == pytest.approx([2.0, 2.0], abs=0.25)


@pytest.mark.parametrize(("order", "rate"), [(0, 2.0), (1, 2.0)])
def test_order_of_the_delayed_term(order: int, rate: float) -> None:
    cut = immersed(0.5, "down")
    states = delay_system(one_mode(), cut)
    exact = multipliers(one_mode(), cut, 15000 * RPM, 2e-3).spectral_radius
    errors = []
    for steps in (40, 80, 160):
        stiffness = 6e8 * 2e-3 * mean_directional_matrices(cut, steps)
        errors.append(abs(np.abs(one_period_multipliers(states, stiffness, 60 / 30000, order)).max() - exact))
    found = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert found.mean() > rate - 0.4


def test_semi_discretisation_limits_of_table_1() -> None:
    rpm = np.array([800, 1050, 1200, 2000.0])
    lobes = semi_discretisation(table_one_model(), HALF_DOWN, rpm * RPM, 10e-3, steps=60)
    exact = collocation(table_one_model(), HALF_DOWN, rpm * RPM, 10e-3)
    np.testing.assert_allclose(lobes.depth_limits, exact.depth_limits, rtol=0.01)
    assert lobes.bifurcations == exact.bifurcations
    np.testing.assert_allclose(lobes.chatter_frequencies, exact.chatter_frequencies, rtol=0.005)


@pytest.mark.parametrize("source", ["model", "measured FRF"])
def test_period_doubling_notch_that_averaged_coefficients_miss(source: str) -> None:
    """1040 to 1070 rpm, down to 1.36 mm near 1050: from the model, and from FRF lines alone."""
    rpm = np.array([1040, 1050, 1060, 1070.0])
    model = table_one_model()
    if source == "model":
        lobes = collocation(model, HALF_DOWN, rpm * RPM, 10e-3)
    else:
        lobes = multi_frequency(model.frf(np.arange(1.0, 120.0, 0.125)), HALF_DOWN, rpm * RPM, 10e-3)
    assert set(lobes.bifurcations) == {"period-doubling"}
    assert 1e3 * lobes.depth_limits.min() == pytest.approx(1.36, abs=0.01)
    np.testing.assert_allclose(lobes.chatter_frequencies, rpm / 60, rtol=1e-6)  # half the tooth passing
    averaged = zero_order(model, HALF_DOWN, rpm * RPM, 10e-3)
    assert (averaged.depth_limits > 1.2 * lobes.depth_limits).sum() >= 2


def test_multi_frequency_approaches_collocation_with_more_harmonics() -> None:
    cut = immersed(0.1, "down")
    exact = collocation(one_mode(), cut, SPEEDS[:3], 12e-3).depth_limits
    errors = [
        np.abs(multi_frequency(one_mode(), cut, SPEEDS[:3], 12e-3, harmonics=n).depth_limits / exact - 1).max()
        for n in (4, 8, 16)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 5e-3


@settings(max_examples=15)
@given(start=st.floats(0, 2.0), width=st.floats(0.2, 1.1), teeth=st.integers(1, 4), angle=st.floats(0.02, 6.2))
def test_fourier_series_of_the_directional_matrix(start: float, width: float, teeth: int, angle: float) -> None:
    cut = replace(HALF_DOWN, teeth=teeth, start_angle=start, exit_angle=start + width)
    n = 400
    coefficients = directional_harmonics(cut, n)
    # Fejer's mean converges wherever alpha is continuous
    orders = np.arange(-n, n + 1)
    weights = (1 - np.abs(orders) / (n + 1)) * np.exp(1j * teeth * orders * angle)
    phi = np.mod(angle + 2 * pi * np.arange(teeth) / teeth, 2 * pi)
    edge = np.abs(np.subtract.outer(phi, [cut.start_angle, cut.exit_angle])).min()
    series = np.real(np.einsum("k,kpq->pq", weights, coefficients))
    if edge > 0.1:
        np.testing.assert_allclose(series, directional_matrix(cut, np.array([angle]))[0], atol=0.05)


@settings(max_examples=10)
@given(turn=st.floats(0, 6.28), rpm=st.floats(700, 2200))
def test_a_mirrored_scale_of_vectors_does_not_move_limits(turn: float, rpm: float) -> None:
    """Right times g, left over g, g complex: the same structure."""
    model = table_one_model()
    factor = 3.0 * np.exp(1j * turn)
    scaled = replace(model, right=model.right * factor, left=model.left / factor)
    speeds = np.array([rpm]) * RPM
    one = collocation(model, HALF_DOWN, speeds, 10e-3)
    two = collocation(scaled, HALF_DOWN, speeds, 10e-3)
    np.testing.assert_allclose(two.depth_limits, one.depth_limits, rtol=1e-7)


def test_absurd_input_is_refused() -> None:
    model = one_mode()
    with pytest.raises(InputError, match="depth"):
        collocation(model, HALF_DOWN, SPEEDS, -1e-3)
    with pytest.raises(InputError, match="speeds"):
        multi_frequency(model, HALF_DOWN, np.array([0.0]), 1e-3)
    with pytest.raises(InputError, match="unstable"):
        collocation(replace(model, poles=-model.poles.conj()), HALF_DOWN, SPEEDS, 1e-3)
    with pytest.raises(InputError, match="steps"):
        semi_discretisation(model, HALF_DOWN, SPEEDS, 1e-3, steps=2)
    none = np.zeros((0, 1), complex)
    empty = ModalModel(none[:, 0], none, none, ("TCP:+X",), ("TCP:+X",))
    with pytest.raises(InputError, match="no mode"):
        collocation(empty, HALF_DOWN, SPEEDS, 1e-3)
    with pytest.raises(InputError, match="calibrate"):
        collocation(replace(model, responses=("TCP:+RX",)), HALF_DOWN, SPEEDS, 1e-3)
