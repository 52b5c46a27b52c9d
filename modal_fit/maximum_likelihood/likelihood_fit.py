"""Maximum-likelihood modal parameters from whole records, with noisy forces and responses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Band, Complex, Index, MillfrfError, Real

from ..models.modal_model import ModalModel
from ..models.out_of_band import fixed_poles, out_of_band_basis, residuals_from
from ..settings import SETTINGS
from .likelihood_model import LikelihoodModel, LikelihoodProblem, gauge_directions, jacobian, prediction, transfer
from .whole_records import NoiseLevels, RecordSpectra, flat_noise, noise_levels


@dataclass(frozen=True)
class LikelihoodFit:
    """Result of a maximum-likelihood fit."""

    model: LikelihoodModel
    covariance: Real  # (n_unknowns, n_unknowns) of the packed unknowns; zero along scalings that change no prediction
    noise: NoiseLevels
    reduced_chi_square: float  # weighted error power over its expectation; 1 where model and noise are right
    log_likelihood: float  # up to a constant
    converged: bool


def maximise_likelihood(start: LikelihoodModel, problem: LikelihoodProblem) -> LikelihoodFit:
    """Fit all unknowns to the lines of all tests at once, with noise on forces and responses.

    The cost is ``sum_k e^H V^-1 e`` with ``e = X - prediction`` and ``V = diag(response noise) + H diag(force
    noise) H^H``. Its gradient is taken at the force corrected for its estimated error, ``F + W H^H V^-1 e``, which
    removes the bias that noise on nearly dependent forces brings into H1 (Pintelon & Schoukens, System Identification,
    2nd ed., section 9.11). Variances of the noise and the unknowns are estimated alternately. ``start`` must lie near
    the optimum; see :func:`linear_start`.
    """
    spectra = problem.spectra
    n_unknowns = start.pack().size - 2 * len(start.poles)  # less the scaling of each pair of vectors
    model, converged = start, False
    frf = transfer(model, problem)
    error = spectra.response - prediction(model, problem, frf)
    # far from the optimum, the misfit would be taken for noise of the forces
    noise = flat_noise(error, spectra.test, spectra.excitation.shape[1])
    for number in range(SETTINGS.noise_rounds):
        if number:
            noise = noise_levels(error, frf, spectra.test, spectra.n_tests, n_unknowns)
        model, frf, error, converged = _gauss_newton(model, problem, noise)
    whitener, log_determinant = _whitener(noise.covariance(frf, spectra.test))
    cost = float(np.sum(np.abs(whitener @ error[..., None]) ** 2))
    # Fisher information under complex noise: twice the product of the whitened Jacobian
    information = 2 * _normal_equations(model, problem, noise, frf, error)[0]
    freedom = spectra.response.size - n_unknowns / 2
    covariance = _covariance(information, model)
    return LikelihoodFit(model, covariance, noise, cost / freedom, -cost - log_determinant, converged)


def _gauss_newton(
    model: LikelihoodModel, problem: LikelihoodProblem, noise: NoiseLevels
) -> tuple[LikelihoodModel, Complex, Complex, bool]:
    """Take Levenberg-Marquardt steps with fixed noise variances.

    Returns the model, its FRF, its equation error, and whether the steps converged.
    """
    damping = 1e-4
    frf, error, cost = _evaluate(model, problem, noise)
    for _ in range(SETTINGS.likelihood_steps):
        weighted, gradient = _normal_equations(model, problem, noise, frf, error)
        scale = np.sqrt(np.maximum(np.diag(weighted), 1e-300))
        matrix, right_side = weighted / np.outer(scale, scale), gradient / scale
        while True:
            # 1e-11 keeps the matrix regular: the scaling of each pair of vectors is free
            step = np.linalg.solve(matrix + (damping + 1e-11) * np.eye(len(matrix)), right_side) / scale
            trial = model.unpack(model.pack() + step)
            if trial.poles.real.max() < 0:
                new_frf, new_error, new_cost = _evaluate(trial, problem, noise)
                if new_cost <= cost:
                    break
            damping *= 10
            if damping > SETTINGS.largest_step_damping:
                return model, frf, error, True
        gain = cost - new_cost
        model, frf, error, cost = trial, new_frf, new_error, new_cost
        damping = max(damping / 10, 1e-12)
        if gain < SETTINGS.likelihood_gain:
            return model, frf, error, True
    return model, frf, error, False


def _evaluate(model: LikelihoodModel, problem: LikelihoodProblem, noise: NoiseLevels) -> tuple[Complex, Complex, float]:
    """Return FRF, equation error and cost of a model."""
    frf = transfer(model, problem)
    error = problem.spectra.response - prediction(model, problem, frf)
    whitener, _ = _whitener(noise.covariance(frf, problem.spectra.test))
    return frf, error, float(np.sum(np.abs(whitener @ error[..., None]) ** 2))


def _whitener(covariance: Complex) -> tuple[Complex, float]:
    """Return the inverse Cholesky factors of the covariance of each line, and the log determinant summed over lines."""
    factor = np.linalg.cholesky(covariance)
    log_determinant = float(2 * np.sum(np.log(np.real(np.einsum("kpp->kp", factor)))))
    return np.asarray(np.linalg.inv(factor), dtype=np.complex128), log_determinant


def _corrected_force(noise: NoiseLevels, spectra: RecordSpectra, frf: Complex, error: Complex) -> Complex:
    """Return the force minus its estimated noise, F + W H^H V^-1 e; see :func:`maximise_likelihood`."""
    if not noise.excitation.any():
        return spectra.excitation
    weighted = np.linalg.solve(noise.covariance(frf, spectra.test), error[..., None])[..., 0]
    correction = noise.excitation[spectra.test] * np.einsum("kpq,kp->kq", frf.conj(), weighted)
    return np.asarray(spectra.excitation + correction)


def _normal_equations(
    model: LikelihoodModel, problem: LikelihoodProblem, noise: NoiseLevels, frf: Complex, error: Complex
) -> tuple[Real, Real]:
    """Return matrix and right side of the Gauss-Newton step of the packed unknowns."""
    force = _corrected_force(noise, problem.spectra, frf, error)
    derivative = jacobian(model, problem, force)
    whitener, _ = _whitener(noise.covariance(frf, problem.spectra.test))
    columns = (whitener @ derivative).reshape(-1, derivative.shape[-1])
    target = (whitener @ error[..., None]).reshape(-1)
    real, imaginary = np.ascontiguousarray(columns.real), np.ascontiguousarray(columns.imag)
    matrix = real.T @ real + imaginary.T @ imaginary
    return np.asarray(matrix), np.asarray(real.T @ target.real + imaginary.T @ target.imag)


def _covariance(information: Real, model: LikelihoodModel) -> Real:
    """Invert the Fisher information on all directions except the scalings that change no prediction."""
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    gauge = gauge_directions(model) / scale[:, None]
    complete, _ = np.linalg.qr(gauge, mode="complete")
    free = complete[:, gauge.shape[1] :] * scale[:, None]
    return np.asarray(free @ np.linalg.inv(free.T @ information @ free) @ free.T)


def linear_start(poles: Complex, problem: LikelihoodProblem) -> LikelihoodModel:
    """Solve for the unknowns by least squares at fixed ``poles`` (rad/s), with residue matrices reduced to rank one.

    Responses of one kind have the same regressors, so that they share one factorisation. The residue matrices have full
    rank at first; their leading singular vectors are the right and left vectors.
    """
    spectra = problem.spectra
    n_modes, n_excitations, n_terms = len(poles), spectra.excitation.shape[1], len(problem.basis)
    n_responses, n_tests = spectra.response.shape[1], spectra.n_tests
    n_rows = 2 * n_modes * n_excitations + n_terms * n_excitations + 2 * n_tests * (n_modes + len(problem.powers))
    solution = np.empty((n_rows, n_responses))
    for derivative in np.unique(spectra.derivative):
        chosen = spectra.derivative == derivative
        design = regressors(poles, problem, int(derivative), n_tests)
        solution[:, chosen] = _solve(design, spectra.response[:, chosen])
    ends = np.cumsum([2 * n_modes * n_excitations, n_terms * n_excitations])
    residues, out_of_band, free = np.split(solution, ends)
    residues = residues.reshape(n_modes, n_excitations, 2, -1)
    out_of_band = np.moveaxis(out_of_band.reshape(n_terms, n_excitations, -1), 1, 2)
    free = free.reshape(n_tests, n_modes + len(problem.powers), 2, n_responses)
    decays = free[:, :, 0] + 1j * free[:, :, 1]
    matrices = np.moveaxis(residues[:, :, 0] + 1j * residues[:, :, 1], 1, 2)
    return _rank_one(poles, matrices, out_of_band, decays[:, :n_modes], decays[:, n_modes:])


def regressors(poles: Complex, problem: LikelihoodProblem, derivative: int, n_tests: int) -> Complex:
    """Return the columns of the linear problem for real unknowns, shape (n_lines, n_unknowns).

    First the residues, mode by mode and excitation by excitation (real and imaginary part), then the out-of-band terms,
    then the transients of ``n_tests`` tests.
    """
    spectra = problem.spectra
    s, force = spectra.s, spectra.excitation
    factor = s**derivative
    plus = factor[:, None] / (s[:, None] - poles)
    minus = factor[:, None] / (s[:, None] - poles.conj())
    residues = np.einsum("krc,kq->krqc", np.stack([plus + minus, 1j * (plus - minus)], axis=2), force)
    out_of_band = np.einsum("nk,kq->knq", factor * problem.basis, force)
    blocks = [residues, out_of_band]
    if n_tests:
        member = (spectra.test[:, None] == np.arange(n_tests)).astype(float)
        free = np.concatenate([plus, problem.powers.T], axis=1)
        blocks.append(np.einsum("kt,kn,c->ktnc", member, free, np.array([1, 1j])))
    return np.concatenate([block.reshape(len(s), -1) for block in blocks], axis=1)


def _solve(columns: Complex, response: Complex) -> Real:
    """Solve a complex equation for real unknowns by least squares, with columns scaled to unit length."""
    design = np.concatenate([columns.real, columns.imag])
    target = np.concatenate([response.real, response.imag])
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    return np.asarray(np.linalg.lstsq(design / scale, target, rcond=1e-12)[0] / scale[:, None])


def _rank_one(
    poles: Complex, matrices: Complex, out_of_band: Real, decays: Complex, smooth: Complex
) -> LikelihoodModel:
    """Reduce the residue matrices to their leading singular pair and express the transients by the right vectors."""
    u, sigma, vh = np.linalg.svd(matrices)
    root = np.sqrt(sigma[:, :1])
    right, left = u[:, :, 0] * root, vh[:, 0] * root
    length = np.sum(np.abs(right) ** 2, axis=1)
    transient = np.einsum("trp,rp->tr", decays, right.conj()) / np.where(length > 0, length, 1.0)
    poles = np.asarray(poles, dtype=complex)
    return LikelihoodModel(poles, right, left, np.ascontiguousarray(out_of_band), transient, smooth)


def best_fit(poles: Complex, spectra: RecordSpectra, band: Band) -> tuple[LikelihoodFit, list[complex]]:
    """Fit with no, one and two fixed poles above the band; keep the best fit by Schwarz's criterion.

    Returns the fit and its fixed poles, rad/s.

    Raises
    ------
    MillfrfError
        No fit gave finite numbers.
    """
    fits = []
    x = 2 * (spectra.s.imag / (2 * np.pi) - band[0]) / (band[1] - band[0]) - 1
    powers = np.array([x**k for k in range(SETTINGS.transient_terms)])
    for above in SETTINGS.poles_above_band:
        fixed = fixed_poles(band, (), above)
        problem = LikelihoodProblem(spectra, out_of_band_basis(spectra.s, band, fixed), powers)
        try:
            fit = maximise_likelihood(linear_start(poles, problem), problem)
        except np.linalg.LinAlgError:  # the normal matrix is singular with these terms
            continue
        if np.isfinite(fit.log_likelihood):
            n_unknowns = fit.model.pack().size - 2 * len(poles)
            criterion = -2 * fit.log_likelihood + n_unknowns * float(np.log(2 * spectra.response.size))
            fits.append((criterion, fit, fixed))
    if not fits:
        raise MillfrfError(f"the refinement of {len(poles)} modes did not converge; choose another band or fewer modes")
    _, fit, fixed = min(fits, key=lambda candidate: candidate[0])
    return fit, fixed


def modal_model_from(
    fit: LikelihoodFit,
    fixed: Sequence[complex],
    band: Band,
    responses: Sequence[str],
    excitations: Sequence[str],
    unit: str,
) -> ModalModel:
    """Return the modes in order of frequency, with residual terms and the covariance of poles and vectors.

    The covariance is widened by the reduced chi-square where that is above 1: a misfit that the noise does not explain
    is an uncertainty, too.
    """
    model = fit.model
    order = np.argsort(np.abs(model.poles))
    n_parameters = 2 * (model.poles.size + model.right.size + model.left.size)
    covariance = fit.covariance[:n_parameters, :n_parameters] * max(1.0, fit.reduced_chi_square)
    index = _sorting_index(model, order)[:n_parameters]
    return ModalModel(
        poles=model.poles[order],
        right=model.right[order],
        left=model.left[order],
        responses=tuple(responses),
        excitations=tuple(excitations),
        quantity="receptance" if unit == "m/N" else "transfer",
        unit=unit,
        residuals=residuals_from(model.out_of_band, band, fixed),
        covariance=covariance[np.ix_(index, index)],
        band=band,
    )


def _sorting_index(model: LikelihoodModel, order: Index) -> Index:
    """Return the place that each packed unknown of the sorted model has in the unsorted model."""
    numbered = model.unpack(np.arange(model.pack().size, dtype=float))
    ordered = replace(numbered, poles=numbered.poles[order], right=numbered.right[order], left=numbered.left[order])
    return ordered.pack().astype(np.int64)
