"""Poly-reference fit: exact recovery, noise, out-of-band modes, order recursion, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimation import Frf, FrfCovariance
from millfrf.core import InputError, MillfrfError
from modal_fit import ModalModel, fit_polyreference
from modal_fit.stabilisation import matrix_fraction_poles
from replay_data import default_structure, table_one_model, tip_model

AXIS = np.arange(0.0625, 40.0, 0.0625)


def noisy(model: ModalModel, share: float, seed: int, quantity: str = "receptance") -> Frf:
    """The model's FRF with noise of ``share`` of each row's mean square, and its true covariance."""
    frf = model.frf(AXIS)
    rng = np.random.default_rng(seed)
    level = share * np.sqrt(np.mean(np.abs(frf.values) ** 2, axis=(0, 2)))
    noise = rng.standard_normal((2, *frf.values.shape)) * level[:, None] / np.sqrt(2)
    n_e = frf.values.shape[2]
    covariance = FrfCovariance(
        np.broadcast_to(np.diag(level**2).astype(complex), (len(AXIS), len(level), len(level))),
        np.broadcast_to(np.eye(n_e, dtype=complex), (len(AXIS), n_e, n_e)),
    )
    values = frf.values + noise[0] + 1j * noise[1]
    if quantity == "accelerance":
        factor = -((2 * np.pi * AXIS) ** 2)
        values = values * factor[:, None, None]
        covariance = FrfCovariance(covariance.response * (factor**2)[:, None, None], covariance.excitation)
        return replace(frf, values=values, quantity=quantity, unit="m/s^2/N", covariance=covariance)
    return replace(frf, values=values, covariance=covariance if share else None)


@pytest.mark.parametrize("band", [(14.5, 23.5), (10.0, 30.0), (14.0, 30.0)])
def test_noise_free_table_1_is_recovered_exactly_in_narrow_bands(band: tuple[float, float]) -> None:
    truth = table_one_model()
    fit = fit_polyreference(truth.frf(AXIS), band)
    assert len(fit.model.poles) == 2
    np.testing.assert_allclose(fit.model.poles, truth.poles, rtol=1e-6)
    f = np.linspace(*band, 50)
    np.testing.assert_allclose(
        fit.model.receptance(f), truth.receptance(f), atol=1e-6 * np.abs(truth.receptance(f)).max()
    )


@pytest.mark.parametrize("quantity", ["receptance", "accelerance"])
def test_close_pair_under_noise_with_out_of_band_modes(quantity: str) -> None:
    """1 % noise, modes at 52 Hz and above left out of the band: no bias beyond three standard errors."""
    truth = tip_model(default_structure())
    fit = fit_polyreference(noisy(truth, 0.01, 3, quantity), (10.0, 30.0))
    assert len(fit.model.poles) == 2
    errors = fit.model.standard_errors()
    assert errors is not None
    assert np.all(np.abs(fit.model.natural_frequencies - truth.natural_frequencies[:2]) < 4 * errors[0])
    assert np.all(np.abs(fit.model.damping_ratios - truth.damping_ratios[:2]) < 4 * errors[1])
    assert np.all(errors[1] < 0.01 * truth.damping_ratios[:2])
    assert fit.reduced_chi_square == pytest.approx(1.0, abs=0.1)
    assert (fit.model.quantity, fit.model.unit) == ("receptance", "m/N")


def test_left_and_right_vectors_keep_their_sides() -> None:
    """Residue matrices, which no scaling touches, against the truth: a transposed matrix would be far off."""
    truth = table_one_model()
    result = fit_polyreference(noisy(truth, 0.005, 1), (12.0, 25.0)).model
    for r in range(2):
        expected = np.outer(truth.right[r], truth.left[r])
        error = np.linalg.norm(np.outer(result.right[r], result.left[r]) - expected) / np.linalg.norm(expected)
        transposed = np.linalg.norm(np.outer(result.right[r], result.left[r]) - expected.T) / np.linalg.norm(expected)
        assert error < 0.03
        assert transposed > 5 * error


def test_lower_orders_from_one_factorisation_equal_their_direct_solution() -> None:
    frf = noisy(tip_model(default_structure()), 0.02, 4)
    together = list(matrix_fraction_poles(frf, (10.0, 30.0), 12))
    for order in (3, 7, 12):
        alone = list(matrix_fraction_poles(frf, (10.0, 30.0), order))[-1]
        np.testing.assert_allclose(np.sort(alone.poles), np.sort(together[order - 1].poles), rtol=1e-5)


@pytest.mark.long
@settings(max_examples=12)
@given(scale=st.floats(1e-6, 1e6), turn=st.floats(0, 6.28))
def test_units_and_axes_do_not_change_the_poles(scale: float, turn: float) -> None:
    model = table_one_model()
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    turned = replace(model, right=scale * model.right @ rotation.T, left=model.left @ rotation.T)
    result = fit_polyreference(turned.frf(AXIS), (14.0, 24.0)).model
    np.testing.assert_allclose(result.poles, model.poles, rtol=1e-5)


def test_lines_without_an_frf_are_left_out_and_said() -> None:
    frf = table_one_model().frf(AXIS)
    holes = (np.arange(len(AXIS)) % 7) == 0
    values = np.where(holes[:, None, None], 1e3, frf.values)
    fit = fit_polyreference(replace(frf, values=values, valid=~holes), (12.0, 25.0))
    np.testing.assert_allclose(fit.model.poles, table_one_model().poles, rtol=1e-6)
    assert any("dependent inputs" in warning for warning in fit.warnings)


def test_no_pole_at_zero_and_none_twice() -> None:
    for seed in range(4):
        model = fit_polyreference(noisy(table_one_model(), 0.03, seed), (10.0, 30.0)).model
        assert model.natural_frequencies.min() > 10
        separation = np.abs(np.subtract.outer(model.poles, model.poles)) + np.eye(len(model.poles)) * 1e9
        assert separation.min() > 1.0


def test_every_dropped_group_has_a_reason() -> None:
    fit = fit_polyreference(noisy(table_one_model(), 0.05, 2), (10.0, 30.0))
    assert all(group.reason for group in fit.dropped)


@pytest.mark.parametrize(
    ("band", "order", "message"),
    [
        ((0.0, 20.0), 20, "starts at 0"),
        ((20.0, 10.0), 20, "empty"),
        ((16.0, 16.2), 20, "too few"),
        ((10.0, 30.0), 1, "order 1"),
    ],
)
def test_unusable_bands_and_orders_are_refused(band: tuple[float, float], order: int, message: str) -> None:
    with pytest.raises(InputError, match=message):
        fit_polyreference(table_one_model().frf(AXIS), band, max_order=order)


def test_noise_alone_has_no_mode() -> None:
    rng = np.random.default_rng(0)
    frf = table_one_model().frf(AXIS)
    noise = rng.standard_normal((2, *frf.values.shape))
    with pytest.raises(MillfrfError, match="no pole is stable"):
        fit_polyreference(replace(frf, values=noise[0] + 1j * noise[1]), (10.0, 30.0), max_order=12)


def one_mode_each(frequencies: list[float], zeta: float) -> ModalModel:
    """Modes with residues of unlike size and direction at three responses and two excitations."""
    rng = np.random.default_rng(7)
    omega = 2 * np.pi * np.array(frequencies)
    n = len(frequencies)
    return ModalModel(
        poles=omega * (-zeta + 1j * np.sqrt(1 - zeta**2)),
        right=rng.standard_normal((n, 3)) + 0.2j * rng.standard_normal((n, 3)),
        left=rng.standard_normal((n, 2)) * omega[:, None] * 1e-8 * (1 + 0.1j),
        responses=("TCP:+X", "TCP:+Y", "TCP:+Z"),
        excitations=("TCP:+X", "TCP:+Y"),
    )


def test_modes_are_found_from_one_end_of_a_wide_band_to_the_other() -> None:
    """Poles near the upper end once fell off the logarithm's branch."""
    frequencies = [110.0, 260.0, 410.0, 560.0, 710.0, 860.0, 970.0]
    truth = one_mode_each(frequencies, 0.01)
    fit = fit_polyreference(truth.frf(np.arange(1.0, 1100.0, 0.5)), (60.0, 1000.0), max_order=24)
    np.testing.assert_allclose(fit.model.poles, truth.poles, rtol=1e-6)


def test_two_modes_closer_than_a_pole_scatters_stay_two() -> None:
    truth = one_mode_each([300.0, 303.0, 380.0], 0.008)
    fit = fit_polyreference(truth.frf(np.arange(200.0, 450.0, 0.25)), (250.0, 420.0), max_order=20)
    np.testing.assert_allclose(fit.model.poles, truth.poles, rtol=1e-5)


@pytest.mark.parametrize("delay", [0.0, 2e-4, 1.1e-3])
def test_delay_of_a_measuring_chain_is_told_from_the_modes(delay: float) -> None:
    structure = one_mode_each([210.0, 320.0, 405.0, 590.0], 0.012)
    truth = replace(structure, quantity="transfer", unit="m/V", delay=delay)
    fit = fit_polyreference(truth.frf(np.arange(100.0, 800.0, 0.5)), (150.0, 700.0), max_order=24)
    assert fit.model.delay == pytest.approx(delay, abs=1e-6)
    np.testing.assert_allclose(fit.model.poles, truth.poles, rtol=1e-4)


def test_a_structure_has_no_delay() -> None:
    with pytest.raises(InputError, match="only a transfer"):
        replace(one_mode_each([10.0], 0.01), delay=1e-3)
