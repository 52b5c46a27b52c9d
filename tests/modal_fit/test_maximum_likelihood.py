"""Maximum-likelihood fit of stacked tests against dense least squares and differences that share nothing with it."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
import scipy

from millfrf.core import Complex
from modal_fit.maximum_likelihood import likelihood_fit
from modal_fit.maximum_likelihood.likelihood_fit import best_fit, maximise_likelihood, modal_model_from, weakest_mode
from modal_fit.maximum_likelihood.likelihood_model import (
    LikelihoodModel,
    LikelihoodProblem,
    gauge_directions,
    linear_start,
    prediction,
    transfer,
)
from modal_fit.maximum_likelihood.normal_equations import (
    evaluate,
    force_noise_information,
    gradient,
    normal_equations,
)
from modal_fit.maximum_likelihood.whole_records import NoiseLevels, RecordSpectra, flat_noise, noise_levels
from modal_fit.models.out_of_band import fixed_poles, out_of_band_basis
from modal_fit.settings import SETTINGS

BAND = (10.0, 30.0)
POLES: Complex = 2 * np.pi * np.array([14.0 * (-0.03 + 1j), 22.0 * (-0.02 + 1j)], dtype=np.complex128)
DERIVATIVE = np.array([2, 0])  # an accelerometer and a displacement sensor
Dense = tuple[np.ndarray, np.ndarray]


def drawn(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def simulated(
    seed: int,
    lines: tuple[int, ...] = (70, 50, 90),
    force_noise: float = 0.0,
    above: float | None = None,
    noise: float = 0.02,
) -> RecordSpectra:
    """Lines of tests of two modes with free decays; ``above`` is the frequency (Hz) of a third mode."""
    rng = np.random.default_rng(seed)
    poles = POLES if above is None else np.append(POLES, 2 * np.pi * above * (-0.02 + 1j))
    right, left = drawn(rng, len(poles), 2), drawn(rng, len(poles), 2)
    tests = []
    for number, count in enumerate(lines):
        s = 2j * np.pi * np.linspace(*BAND, count)
        force, decay = drawn(rng, count, 2), drawn(rng, len(poles))
        plus, minus = 1 / (s[:, None] - poles), 1 / (s[:, None] - poles.conj())
        motion = (plus * (force @ left.T + 0.3 * decay)) @ right + (minus * (force @ left.conj().T)) @ right.conj()
        # both sensors have signals of size 1
        motion *= (s[:, None] / 100) ** DERIVATIVE
        motion += noise * np.std(motion) * drawn(rng, count, 2)
        force += force_noise * drawn(rng, count, 2)
        tests.append((s, np.full(count, number), force, motion))
    s, test, force, motion = (np.concatenate(column) for column in zip(*tests, strict=True))
    return RecordSpectra(np.asarray(s, dtype=np.complex128), test, force, motion, DERIVATIVE)


def problem_of(
    spectra: RecordSpectra, above: tuple[float, ...] = (2.0,), below: tuple[float, ...] = ()
) -> LikelihoodProblem:
    x = np.linspace(-1, 1, 101)
    x = np.interp(spectra.s.imag / (2 * np.pi), np.linspace(*BAND, 101), x)
    basis = out_of_band_basis(spectra.s, BAND, fixed_poles(BAND, below, above))
    return LikelihoodProblem(spectra, basis, np.array([np.ones_like(x), x]))


def dense_frf(model: LikelihoodModel, problem: LikelihoodProblem) -> np.ndarray:
    """Return the FRF (n_lines, n_responses, n_excitations) as the docstring of the model writes it."""
    frf = np.zeros((len(problem.spectra.s), 2, 2), dtype=complex)
    for k, s in enumerate(problem.spectra.s):
        for pole, right, left in zip(model.poles, model.right, model.left, strict=True):
            residue = np.outer(right, left)
            frf[k] += residue / (s - pole) + residue.conj() / (s - pole.conj())
        frf[k] += np.tensordot(problem.basis[:, k], model.out_of_band, 1)
        frf[k] *= (s**DERIVATIVE)[:, None]
    return frf


def dense_prediction(model: LikelihoodModel, problem: LikelihoodProblem, force: np.ndarray) -> np.ndarray:
    motion = np.asarray(np.einsum("kpq,kq->kp", dense_frf(model, problem), force))
    for k, (s, t) in enumerate(zip(problem.spectra.s, problem.spectra.test, strict=True)):
        for pole, right, decay in zip(model.poles, model.right, model.transient[t], strict=True):
            motion[k] += s**DERIVATIVE * right * decay / (s - pole)
        motion[k] += problem.powers[:, k] @ model.smooth[t]
    return motion


def dense_weights(model: LikelihoodModel, problem: LikelihoodProblem, noise: NoiseLevels) -> Dense:
    """Return the inverse covariance of each line, and the error."""
    frf, test = dense_frf(model, problem), problem.spectra.test
    covariance = np.einsum("kpq,kq,kuq->kpu", frf, noise.excitation[test], frf.conj())
    covariance += noise.response[test][:, :, None] * np.eye(2)
    error = problem.spectra.response - dense_prediction(model, problem, problem.spectra.excitation)
    return np.linalg.inv(covariance), error


def dense_cost(model: LikelihoodModel, problem: LikelihoodProblem, noise: NoiseLevels) -> float:
    weights, error = dense_weights(model, problem, noise)
    return float(np.real(np.einsum("kp,kpu,ku->", error.conj(), weights, error)))


def steps_of(model: LikelihoodModel) -> np.ndarray:
    """Return steps of differences for each unknown: a share of the largest of its kind."""
    sizes = model.unpack(np.ones(model.pack().size))
    for name in ("poles", "right", "left", "out_of_band", "transient", "smooth"):
        array = getattr(sizes, name)
        array[...] = array * np.abs(getattr(model, name)).max()
    return 1e-6 * np.abs(sizes.pack())


@pytest.mark.parametrize("force_noise", [0.0, 0.1])
def test_the_normal_equations_are_those_of_a_dense_jacobian_by_differences(force_noise: float) -> None:
    """J^H V^-1 J and J^H V^-1 e; the right side is also minus half the gradient of the cost, in which V moves too."""
    problem = problem_of(simulated(1, force_noise=force_noise))
    model = linear_start(POLES * 1.01, problem)
    noise = NoiseLevels(
        np.array([[1.0, 2.0], [0.5, 1.5], [2.0, 1.0]]), force_noise * np.array([[1, 0], [2, 0.5], [0, 1]])
    )
    at = evaluate(model, problem, noise)
    matrix, right_side = normal_equations(problem, noise, at)
    weights, error = dense_weights(model, problem, noise)
    assert at.cost == pytest.approx(dense_cost(model, problem, noise), rel=1e-9)
    assert at.weights.log_determinant == pytest.approx(-np.log(np.linalg.det(weights).real).sum(), rel=1e-9)
    weighted = np.einsum("kpu,ku->kp", weights, error)
    pulled = np.einsum("kpq,kp->kq", dense_frf(model, problem).conj(), weighted)
    force = problem.spectra.excitation + noise.excitation[problem.spectra.test] * pulled
    columns, gradient = [], []
    for place, size in enumerate(steps_of(model)):
        step = np.zeros(model.pack().size)
        step[place] = size
        ahead, behind = (model.unpack(model.pack() + sign * step) for sign in (1, -1))
        derivative = (dense_prediction(ahead, problem, force) - dense_prediction(behind, problem, force)) / (2 * size)
        columns.append(derivative)
        gradient.append((dense_cost(ahead, problem, noise) - dense_cost(behind, problem, noise)) / (2 * size))
    jacobian = np.array(columns)
    expected = np.real(np.einsum("akp,kpu,bku->ab", jacobian.conj(), weights, jacobian, optimize=True))
    scale = np.sqrt(np.diag(expected))
    np.testing.assert_allclose(matrix / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-7)
    np.testing.assert_allclose(right_side / scale, -0.5 * np.array(gradient) / scale, atol=1e-5 * np.sqrt(at.cost))
    free = gauge_directions(model)
    assert np.abs(matrix @ free / scale[:, None]).max() < 1e-9 * np.abs(matrix / scale[:, None]).max()


def test_the_optimum_is_that_of_dense_least_squares(monkeypatch: pytest.MonkeyPatch) -> None:
    """Poles, residues and the covariance of the poles of scipy's solver on all residuals, by differences."""

    def of_responses(error: np.ndarray, frf: np.ndarray, spectra: RecordSpectra, n_unknowns: int) -> NoiseLevels:
        return flat_noise(error, spectra)

    monkeypatch.setattr(likelihood_fit, "noise_levels", of_responses)  # noise of forces makes weights, which move
    problem = problem_of(simulated(2))
    optimum = maximise_likelihood(linear_start(POLES * 1.01, problem), problem)
    size, start = steps_of(optimum.at.model) * 1e6, optimum.at.model
    deviations = np.sqrt(optimum.noise.response[problem.spectra.test])

    def residuals(scaled: np.ndarray) -> np.ndarray:
        model = start.unpack(scaled * size)
        error = problem.spectra.response - dense_prediction(model, problem, problem.spectra.excitation)
        return np.concatenate([(error / deviations).real.ravel(), (error / deviations).imag.ravel()])

    rough = start.pack() / size + 1e-3 * np.random.default_rng(0).standard_normal(size.size)
    dense = scipy.optimize.least_squares(residuals, rough, jac="3-point", xtol=1e-13, ftol=1e-13, gtol=1e-13)
    model, fit = start.unpack(dense.x * size), optimum.fit()
    assert optimum.at.cost == pytest.approx(2 * dense.cost, rel=1e-6)
    # complex noise of variance 1 has variance 1/2 in each part; each mode has two scalings that change nothing
    lengths = np.linalg.norm(dense.jac, axis=0)
    _, singular, rows = np.linalg.svd(dense.jac / lengths, full_matrices=False)
    free = (rows[:-4] / singular[:-4, None] / np.sqrt(2)).T * (size / lengths)[:, None]
    covariance = (free @ free.T)[:4, :4]
    errors = np.sqrt(np.diag(covariance))
    difference = np.concatenate([(model.poles - start.poles).real, (model.poles - start.poles).imag])
    # the last step may gain SETTINGS.likelihood_gain; what is left is of second order in it
    assert np.abs(difference / errors).max() < 0.02
    relative = fit.covariance[:4, :4] / np.outer(errors, errors)
    np.testing.assert_allclose(relative, covariance / np.outer(errors, errors), atol=1e-3)
    residues = [np.einsum("rp,rq->rpq", each.right, each.left) for each in (model, start)]
    np.testing.assert_allclose(residues[1], residues[0], atol=1e-4 * np.abs(residues[0]).max())


@pytest.mark.parametrize("seed", [3, 4])
def test_no_descent_is_left_at_the_optimum_with_noise_on_forces(seed: int) -> None:
    """The gradient of the dense cost promises no gain that the tolerance does not allow."""
    problem = problem_of(simulated(seed, lines=(200, 150), force_noise=0.05))
    optimum = maximise_likelihood(linear_start(POLES * 1.01, problem), problem)
    assert optimum.noise.excitation.any()
    model, gradient = optimum.at.model, []
    for place, size in enumerate(steps_of(model)):
        step = np.zeros(model.pack().size)
        step[place] = size
        ahead, behind = (
            dense_cost(model.unpack(model.pack() + sign * step), problem, optimum.noise) for sign in (1, -1)
        )
        gradient.append((ahead - behind) / (2 * size))
    promised = 0.5 * np.array(gradient) @ optimum.fit().covariance @ np.array(gradient)
    assert 0 <= promised < SETTINGS.likelihood_gain


@pytest.mark.parametrize("above", [None, 38.0])
@pytest.mark.parametrize("seed", [5, 6])
def test_fewer_terms_are_left_out_only_where_they_would_lose(
    seed: int, above: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The best fit is that of all numbers of fixed poles, each fitted to the end, at a fraction of the evaluations."""
    spectra = simulated(seed, lines=(300, 200, 250), above=above, force_noise=0.02)
    calls: list[int] = []

    def counted(*arguments: object) -> Dense:
        calls.append(1)
        return normal_equations(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(likelihood_fit, "normal_equations", counted)
    every = []
    for below, above_band in SETTINGS.poles_outside_band:
        problem = problem_of(spectra, above_band, below)
        every.append(maximise_likelihood(linear_start(POLES * 1.01, problem), problem))
    best = min(every, key=lambda optimum: optimum.criterion)
    spent = len(calls)
    calls.clear()
    fit, fixed = best_fit(POLES * 1.01, spectra, BAND)
    assert len(best.problem.basis) == 2 + 2 * len(fixed)
    # the alternation of noise and unknowns ends where they move by sqrt(likelihood_gain) of their errors
    apart = fit.model.poles - best.at.model.poles
    errors = np.sqrt(np.diag(fit.covariance)[: 2 * len(POLES)])
    assert np.abs(np.concatenate([apart.real, apart.imag]) / errors).max() < 2 * np.sqrt(SETTINGS.likelihood_gain)
    # poles, left vectors and transients alone are damped, so that few steps are needed: two or three a round
    assert spent < 15 * len(SETTINGS.poles_outside_band)
    if above is not None:
        assert len(calls) < 0.7 * spent


def dependent(seed: int, n_lines: int = 700, ratio: float = 0.03) -> tuple[LikelihoodModel, LikelihoodProblem]:
    """Tests of two modes whose two forces are one but for a share of ``ratio``, and noise of .02 on all signals."""
    rng = np.random.default_rng(100)
    truth = linear_start(POLES, problem_of(simulated(1, noise=0.0), ()))
    truth = replace(truth, out_of_band=0 * truth.out_of_band, transient=0 * truth.transient, smooth=0 * truth.smooth)
    tests = []
    for number in range(truth.transient.shape[0]):
        s = 2j * np.pi * np.linspace(*BAND, n_lines)
        common, apart = drawn(rng, n_lines, 1), drawn(rng, n_lines, 2)
        tests.append((s, np.full(n_lines, number), common @ np.array([[1.0, -0.7]]) + ratio * apart))
    s, test, force = (np.concatenate(column) for column in zip(*tests, strict=True))
    empty = RecordSpectra(s, test, force, np.zeros((len(s), 2), dtype=complex), DERIVATIVE)
    problem = problem_of(empty, ())
    motion = prediction(truth, problem, transfer(truth, problem)).T
    noise = np.random.default_rng(seed)
    size = 0.02 * np.sqrt(np.mean(np.abs(motion) ** 2, axis=0))
    motion = motion + size * drawn(noise, *motion.shape) / np.sqrt(2)
    force = force + 0.02 * drawn(noise, *force.shape) / np.sqrt(2)
    return truth, problem_of(replace(empty, excitation=force, response=motion), ())


def residues_of(model: LikelihoodModel, packed: np.ndarray | None = None) -> np.ndarray:
    model = model if packed is None else model.unpack(packed)
    residues = np.einsum("rp,rq->rpq", model.right, model.left).ravel()
    return np.concatenate([model.poles.real, model.poles.imag, residues.real, residues.imag])


def test_errors_of_residues_hold_where_noisy_forces_are_nearly_dependent() -> None:
    """The sum of squared errors over their covariance is chi-square distributed over draws of the noise.

    A covariance that counts the noise of forces as excitation would be too small.
    """
    total, freedom = 0.0, 0
    for seed in range(40):
        truth, problem = dependent(seed)
        optimum = maximise_likelihood(linear_start(POLES * 1.01, problem), problem)
        packed = optimum.at.model.pack()
        size = 1e-6 * np.abs(packed).max()
        ahead, behind = (
            np.array([residues_of(truth, packed + sign * step) for step in size * np.eye(len(packed))])
            for sign in (1, -1)
        )
        slopes = (ahead - behind).T / (2 * size)
        covariance = slopes @ optimum.fit().covariance @ slopes.T
        scale = np.sqrt(np.diag(covariance))
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        assert np.sum(values > 1e-8) == 16  # two poles, and two matrices of rank one with six numbers each
        errors = (residues_of(optimum.at.model) - residues_of(truth)) / scale
        total += float(np.sum((vectors[:, -16:].T @ errors) ** 2 / values[-16:]))
        freedom += 16
    low, high = scipy.stats.chi2.ppf([0.001, 0.999], freedom)
    assert low < total < high


def test_noise_of_forces_is_found_where_they_are_nearly_dependent() -> None:
    """Estimated with the true FRF, over tests and draws: the mean is the variance of the noise that was drawn."""
    result = []
    for seed in range(30):
        truth, problem = dependent(seed)
        frf = transfer(truth, problem)
        levels = noise_levels(problem.response - prediction(truth, problem, frf), frf, problem.spectra, 0)
        result.append(levels.excitation / 0.02**2)
    values = np.array(result).reshape(-1, 2)
    error = values.std(axis=0) / np.sqrt(len(values))
    assert np.abs(values.mean(axis=0) - 1).max() < 3.3 * error.max()


def test_force_noise_adds_to_the_matrix_what_its_draws_add() -> None:
    """Normal equations of forces with the errors that corrected forces have, averaged over draws."""
    truth, problem = dependent(0, n_lines=300)
    spectra, rng = problem.spectra, np.random.default_rng(1)
    response = 0.3 * np.mean(np.abs(problem.response) ** 2, axis=1)
    noise = NoiseLevels(np.tile(response, (3, 1)), np.full((3, 2), 0.3))
    bare = replace(problem, spectra=replace(spectra, response=prediction(truth, problem, transfer(truth, problem)).T))
    at = evaluate(truth, bare, noise)
    expected = force_noise_information(bare, noise, at)
    exact = normal_equations(bare, noise, at)[0]
    by_force = np.sqrt(noise.excitation[spectra.test] / 2) * drawn(rng, 200, *spectra.excitation.shape)
    by_sensor = np.sqrt(noise.response[spectra.test] / 2) * drawn(rng, 200, *spectra.response.shape)
    total = np.zeros_like(exact)
    for force, sensor in zip(by_force, by_sensor, strict=True):
        spoiled = replace(spectra, excitation=spectra.excitation + force, response=bare.spectra.response + sensor)
        drawn_problem = replace(problem, spectra=spoiled)
        total += normal_equations(drawn_problem, noise, evaluate(truth, drawn_problem, noise))[0] / 200
    scale = np.sqrt(np.maximum(np.diag(total), 1e-300))
    np.testing.assert_allclose((total - exact) / np.outer(scale, scale), expected / np.outer(scale, scale), atol=0.02)
    assert np.max(np.diag(expected) / np.diag(total)) > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_mode_that_follows_noise_is_not_needed(seed: int) -> None:
    spectra = simulated(seed, lines=(300, 200, 250), force_noise=0.05, noise=0.1)
    n_values = 2 * spectra.response.size
    assert weakest_mode(best_fit(POLES * 1.01, spectra, BAND)[0], range(2), n_values)[1]
    false = 2 * np.pi * 18.0 * (-0.02 + 1j)
    fit, _ = best_fit(np.append(POLES * 1.01, false), spectra, BAND)
    assert weakest_mode(fit, range(3), n_values) == (2, False)


@pytest.mark.parametrize("apart", [1e-3, 1e-5])
def test_nearly_equal_modes_have_large_errors_and_no_negative_variances(apart: float) -> None:
    """Their errors came out negative by rounding, and the fit ended in an error of the eigenvalues."""
    problem = problem_of(simulated(3, lines=(300, 200, 250), force_noise=0.05))
    model = linear_start(np.append(POLES, POLES[1] * (1 + apart)), problem)
    noise = NoiseLevels(np.full((3, 2), 1e-4), np.full((3, 2), 1e-3))
    optimum = likelihood_fit.Optimum(problem, evaluate(model, problem, noise), noise, True)
    covariance = optimum.fit().covariance
    assert np.isfinite(covariance).all()
    assert np.diag(covariance).min() >= 0
    assert np.linalg.eigvalsh(covariance).min() >= -1e-12 * np.linalg.eigvalsh(covariance).max()


def test_a_pole_that_crossed_the_real_axis_is_described_by_the_other_one_of_its_pair() -> None:
    """Such a fit ended with "pole -48.15-0.3938j has a negative imaginary part; give the upper half"."""
    spectra = simulated(3)
    fit, fixed = best_fit(POLES * 1.01, spectra, BAND)
    arguments = (fixed, BAND, ("A:+X", "A:+Y"), ("B:+X", "B:+Y"), "m/N")
    expected = modal_model_from(fit, *arguments)
    lower = np.array([True, False])
    conjugated = replace(
        fit.model,
        poles=np.where(lower, fit.model.poles.conj(), fit.model.poles),
        right=np.where(lower[:, None], fit.model.right.conj(), fit.model.right),
        left=np.where(lower[:, None], fit.model.left.conj(), fit.model.left),
    )
    size = conjugated.pack().size
    signs = (conjugated.pack() / fit.model.pack())[: 2 * (conjugated.poles.size + 4 + 4)]
    signs = np.concatenate([signs, np.ones(size - len(signs))])
    given = replace(fit, model=conjugated, covariance=fit.covariance * np.outer(signs, signs))
    model = modal_model_from(given, *arguments)
    np.testing.assert_allclose(model.frf(np.linspace(*BAND, 50)).values, expected.frf(np.linspace(*BAND, 50)).values)
    np.testing.assert_allclose(model.standard_errors(), expected.standard_errors())
    assert model.covariance is not None
    np.testing.assert_allclose(model.covariance, expected.covariance)


def test_memory_is_far_below_that_of_a_dense_jacobian() -> None:
    problem = problem_of(simulated(7, lines=(900,) * 8))
    model = linear_start(POLES * 1.01, problem)
    noise = NoiseLevels(np.ones((8, 2)), np.full((8, 2), 0.01))
    at = evaluate(model, problem, noise)
    normal_equations(problem, noise, at)
    tracemalloc.start()
    try:
        normal_equations(problem, noise, at)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    dense = 16 * problem.spectra.response.size * model.pack().size
    assert peak < 0.25 * dense


@pytest.mark.parametrize("seed", range(3))
def test_undetermined_modes_outside_the_band_leave_no_unfinished_fit(seed: int) -> None:
    """Their poles could be anywhere, so that the steps never ended and the errors of the others were not theirs."""
    spectra = simulated(seed, lines=(300, 200, 250), force_noise=0.02)
    false = 2 * np.pi * np.array([39.0, 41.0]) * (-0.02 + 1j)
    fit, _ = best_fit(np.append(POLES * 1.01, false), spectra, BAND)
    alone, _ = best_fit(POLES * 1.01, spectra, BAND)
    assert fit.converged
    assert len(fit.model.poles) == 2
    errors = np.sqrt(np.diag(alone.covariance)[:4])
    apart = fit.model.poles[:2] - alone.model.poles
    assert np.abs(np.concatenate([apart.real, apart.imag]) / errors).max() < 2 * np.sqrt(SETTINGS.likelihood_gain)


@pytest.mark.parametrize("seed", range(3))
def test_a_bent_step_follows_a_curved_valley(seed: int) -> None:
    """Along ``step t + bend t^2`` the error has no second derivative that the unknowns could take away."""
    problem = problem_of(simulated(seed, above=38.0), ())
    start = linear_start(np.append(POLES, 2 * np.pi * 41.0 * (-0.05 + 1j)), problem)
    noise = NoiseLevels(np.full((3, 2), 1e-4), np.full((3, 2), 1e-4))
    at = evaluate(start, problem, noise)
    matrix, slope = normal_equations(problem, noise, at)
    free = likelihood_fit._free_directions(start, matrix)

    def solved(right_side: np.ndarray) -> np.ndarray:
        return np.asarray(free @ np.linalg.solve(free.T @ matrix @ free, free.T @ right_side))

    np.testing.assert_allclose(gradient(problem, noise, at, at.error), slope, atol=1e-9 * np.abs(slope).max())
    step = 0.01 * solved(slope)
    bend = solved(likelihood_fit._bending(problem, noise, at, step))

    def curvature(bent: np.ndarray) -> np.ndarray:
        def error(t: float) -> np.ndarray:
            model = start.unpack(start.pack() + t * step + t**2 * bent)
            return problem.response - prediction(model, problem, transfer(model, problem))

        second = (error(0.1) - 2 * at.error + error(-0.1)) / 0.1**2
        return np.asarray(free.T @ gradient(problem, noise, at, second))

    assert np.linalg.norm(curvature(bend)) < 0.01 * np.linalg.norm(curvature(np.zeros_like(bend)))
