"""The fit of FRF matrices: derivatives, transposition, shifting rigs, weak and close modes, error bars, windows."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimation import Frf
from modal_fit import ModalFit, ModalModel, fit_polyreference, read_modal_model, write_modal_model
from modal_fit.frf_fit.elimination import Modes, eliminate
from modal_fit.frf_fit.measured_lines import measured_lines, neighbour_noise
from modal_fit.frf_fit.refinement import normal_equations, without_response

Complex = NDArray[np.complex128]
AXIS = np.arange(0.25, 120.0, 0.125)
FREQUENCIES = np.array([14.0, 31.0, 32.0, 55.0, 88.0, 140.0])
DAMPINGS = np.array([0.02, 0.012, 0.015, 0.008, 0.01, 0.01])


def poles_of(frequencies: NDArray[np.float64], dampings: NDArray[np.float64]) -> Complex:
    return np.asarray(2 * np.pi * frequencies * (-dampings + 1j * np.sqrt(1 - dampings**2)))


def vectors(n_responses: int, n_excitations: int, seed: int = 5) -> tuple[Complex, Complex]:
    """Complex right and left vectors; one near pair, and one mode above the band."""
    rng = np.random.default_rng(seed)
    right = rng.standard_normal((6, n_responses)) + 0.2j * rng.standard_normal((6, n_responses))
    left = rng.standard_normal((6, n_excitations)) + 0.2j * rng.standard_normal((6, n_excitations))
    return right / FREQUENCIES[:, None] * 1e-3, left


def accelerances(right: Complex, left: Complex, shifts: NDArray[np.float64] | None = None) -> Complex:
    """By hand, not by `ModalModel`; ``shifts`` (n_responses,) changes all frequencies from response to response."""
    s = 2j * np.pi * AXIS
    values = np.zeros((len(s), right.shape[1], left.shape[1]), dtype=complex)
    for p in range(right.shape[1]):
        poles = poles_of(FREQUENCIES * (1 + (0 if shifts is None else shifts[p])), DAMPINGS)
        for pole, r, q in zip(poles, right[:, p], left, strict=True):
            term = np.outer(1 / (s - pole), r * q) + np.outer(1 / (s - pole.conj()), (r * q).conj())
            values[:, p] += s[:, None] ** 2 * term
    return values


def as_frf(values: Complex) -> Frf:
    responses = tuple(f"{k + 1}:+Z" for k in range(values.shape[1]))
    excitations = tuple(f"{k + 1}:+X" for k in range(values.shape[2]))
    return Frf(AXIS, values, responses, excitations, "accelerance", "m/s^2/N", np.ones(len(AXIS), dtype=bool))


def noisy(values: Complex, share: float, seed: int) -> Complex:
    rng = np.random.default_rng(seed)
    level = share * np.sqrt(np.mean(np.abs(values) ** 2, axis=0)) / np.sqrt(2)
    return np.asarray(values + level * (rng.standard_normal(values.shape) + 1j * rng.standard_normal(values.shape)))


def natural_frequencies(fit: ModalFit) -> NDArray[np.float64]:
    return fit.model.natural_frequencies


@pytest.fixture(scope="module")
def lines():
    values = noisy(accelerances(*vectors(4, 2)), 0.02, 1)
    inside = (AXIS > 8) & (AXIS < 105)
    return measured_lines(as_frf(values), inside, (8.0, 105.0), np.ones((inside.sum(), 4, 2)))


def test_the_gradient_is_that_of_the_cost(lines) -> None:
    """Kaufman's Jacobian leaves a term out, but not of the gradient: against central differences of the cost."""
    _, left = vectors(4, 2)
    modes = Modes(poles_of(FREQUENCIES[:5] * 1.002, DAMPINGS[:5] * 1.1), left[:5]).scaled()
    gradient = normal_equations(modes, lines, eliminate(modes, lines)).gradient.sum(axis=1)
    n_unknowns = len(gradient) // 2
    for number in range(len(gradient)):
        step = np.zeros(n_unknowns, dtype=complex)
        size = 1e-4 if number % n_unknowns < 5 else 1e-6
        step[number % n_unknowns] = size if number < n_unknowns else 1j * size
        costs = [eliminate(modes.moved(sign * step), lines).cost for sign in (1, -1)]
        assert -(costs[0] - costs[1]) / (4 * size) == pytest.approx(gradient[number], rel=1e-3, abs=1e-6 * costs[0])


def test_a_response_left_out_of_the_sums_is_one_left_out_of_the_data(lines) -> None:
    _, left = vectors(4, 2)
    modes = Modes(poles_of(FREQUENCIES[:5], DAMPINGS[:5]), left[:5]).scaled()
    matrix, gradient = without_response(normal_equations(modes, lines, eliminate(modes, lines)), 2)
    fewer = replace(lines, values=lines.values[:, :, [0, 1, 3]], whitening=np.eye(3))
    direct = normal_equations(modes, fewer, eliminate(modes, fewer))
    np.testing.assert_allclose(matrix, direct.matrix, rtol=1e-9, atol=1e-9 * np.abs(direct.matrix).max())
    np.testing.assert_allclose(gradient, direct.gradient.sum(axis=1), rtol=1e-7, atol=1e-9 * np.abs(gradient).max())


@pytest.mark.parametrize("shape", [(6, 1), (5, 3), (3, 3)])
def test_modes_vectors_and_residuals_come_back(shape: tuple[int, int]) -> None:
    """Five modes, two of them within one half-power band, a sixth above the band; accelerance with 1 % noise."""
    clean = accelerances(*vectors(*shape))
    fit = fit_polyreference(as_frf(noisy(clean, 0.01, 2)), (8.0, 105.0))
    assert len(natural_frequencies(fit)) == 5
    np.testing.assert_allclose(natural_frequencies(fit), FREQUENCIES[:5], rtol=2e-3)
    inside = (AXIS > 8) & (AXIS < 105)
    back = -((2 * np.pi * AXIS[inside]) ** 2)[:, None, None] * fit.model.receptance(AXIS[inside])
    error = np.sqrt(np.mean(np.abs(back - clean[inside]) ** 2, axis=0) / np.mean(np.abs(clean[inside]) ** 2, axis=0))
    assert error.max() < 0.004
    assert fit.status == "refined"
    assert not fit.warnings


def test_the_transposed_matrix_has_the_same_modes() -> None:
    frf = as_frf(noisy(accelerances(*vectors(7, 2)), 0.02, 3))
    turned = replace(frf, values=frf.values.transpose(0, 2, 1), responses=frf.excitations, excitations=frf.responses)
    first, second = (fit_polyreference(each, (8.0, 105.0)).model for each in (frf, turned))
    np.testing.assert_allclose(first.poles, second.poles, rtol=1e-12)
    np.testing.assert_allclose(first.right, second.left, rtol=1e-12)
    assert first.covariance is not None
    assert second.covariance is not None
    np.testing.assert_allclose(np.diag(first.covariance)[:10], np.diag(second.covariance)[:10], rtol=1e-9)


def test_frequencies_that_shift_from_point_to_point_are_no_second_modes() -> None:
    """A roving sensor loads the structure: every point sees other frequencies, by up to a fifth of a bandwidth."""
    shifts = 0.003 * np.random.default_rng(8).standard_normal(12)
    values = noisy(accelerances(*vectors(12, 2), shifts), 0.002, 4)
    fit = fit_polyreference(as_frf(values), (8.0, 105.0))
    nearest = np.abs(natural_frequencies(fit)[:, None] - FREQUENCIES[:5]).argmin(axis=1)
    assert len(set(nearest)) == len(natural_frequencies(fit)) >= 4
    np.testing.assert_allclose(natural_frequencies(fit), FREQUENCIES[nearest], rtol=0.003)


def test_a_weak_mode_beside_a_strong_one_is_found_where_noise_allows() -> None:
    """A tenth of the strong neighbour, half a bandwidth away, 300 times the noise power."""
    right, left = vectors(6, 2)
    right[2] = 0.15 * right[2]
    fit = fit_polyreference(as_frf(noisy(accelerances(right, left), 0.003, 5)), (8.0, 105.0))
    assert len(natural_frequencies(fit)) == 5
    assert np.abs(natural_frequencies(fit) - 32.0).min() < 0.1


def test_an_exponential_window_adds_no_damping() -> None:
    """The FRF stands at ``i w + 1/tau``; with tau = 2 s it seems to have twice the damping of the lowest mode."""
    right, left = vectors(4, 2)
    s = 2j * np.pi * AXIS + 0.5
    values = np.zeros((len(s), 4, 2), dtype=complex)
    for pole, r, q in zip(poles_of(FREQUENCIES, DAMPINGS), right, left, strict=True):
        values += np.einsum("k,p,q->kpq", s**2 / (s - pole), r, q)
        values += np.einsum("k,p,q->kpq", s**2 / (s - pole.conj()), r.conj(), q.conj())
    frf = replace(as_frf(noisy(values, 0.005, 7)), exponential_time_constant=2.0)
    model = fit_polyreference(frf, (8.0, 105.0)).model
    np.testing.assert_allclose(model.damping_ratios, DAMPINGS[:5], rtol=0.03)


def test_noise_of_neighbouring_lines_is_the_noise() -> None:
    values = accelerances(*vectors(3, 2))
    spoilt = noisy(values, 0.03, 9)
    true = 0.03**2 * np.mean(np.abs(values) ** 2, axis=0)
    np.testing.assert_allclose(np.median(neighbour_noise(spoilt), axis=0), true, rtol=0.3)


def test_errors_travel_through_the_file(tmp_path) -> None:
    model = fit_polyreference(as_frf(noisy(accelerances(*vectors(4, 2)), 0.01, 2)), (8.0, 105.0)).model
    write_modal_model(tmp_path / "model.json", model)
    again = read_modal_model(tmp_path / "model.json")
    assert model.errors is not None
    assert again.errors is not None
    np.testing.assert_allclose(again.errors.total, model.errors.total)


def covered(model: ModalModel) -> NDArray[np.bool_]:
    errors = model.errors
    assert errors is not None
    miss = np.stack([model.natural_frequencies - FREQUENCIES[:5], model.damping_ratios - DAMPINGS[:5]], axis=1)
    return np.asarray(np.abs(miss) < 1.96 * errors.total)


@pytest.mark.slow
def test_bars_cover_the_truth() -> None:
    """Of 400 numbers 92 to 99 % within 1.96 standard errors."""
    clean = accelerances(*vectors(5, 2))
    held = [covered(fit_polyreference(as_frf(noisy(clean, 0.02, seed)), (8.0, 105.0)).model) for seed in range(40)]
    assert 0.92 <= np.mean(held) <= 0.99
