"""Maximum-likelihood modal parameters from whole records, with noisy forces and responses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, MillfrfError, Real

from ..models.modal_model import ModalModel
from ..models.out_of_band import ABOVE, out_of_band_basis, residuals_from
from .likelihood_model import LikelihoodModel, Setting, gauge_directions, jacobian, prediction, transfer
from .whole_records import NoiseLevels, RecordSpectra, flat_noise, noise_levels

_NOISE_ROUNDS = 3
_STEPS = 25
_ENOUGH = 0.02  # gain of the cost, in units where one standard error is worth 1


@dataclass(frozen=True)
class LikelihoodFit:
    """Result of a maximum-likelihood fit.

    Parameters
    ----------
    model
        The unknowns at the optimum.
    covariance : (n_unknowns, n_unknowns)
        Covariance of the packed unknowns, free of the scaling that changes no prediction.
    noise
        Noise variances that were found.
    reduced_chi_square
        Weighted error power over its expectation; 1 where model and noise description hold.
    log_likelihood
        Logarithm of the likelihood, up to a constant.
    converged
        Whether the last step gained less than 1e-8 of the cost.
    """

    model: LikelihoodModel
    covariance: Real
    noise: NoiseLevels
    reduced_chi_square: float
    log_likelihood: float
    converged: bool


def maximise_likelihood(start: LikelihoodModel, setting: Setting) -> LikelihoodFit:
    """Fit all unknowns to the lines of all tests at once, with noise on forces and responses.

    The cost is ``sum_k e^H V^-1 e`` with ``e = X - prediction`` and ``V = diag(response noise) + H diag(force
    noise) H^H``; its gradient is taken at the force freed of its estimated error, ``F + W H^H V^-1 e``, which removes
    the bias that noise on nearly dependent forces brings into H1 (Pintelon & Schoukens, System Identification,
    2nd ed., section 9.11). Variances of the noise and the unknowns are found in turn.

    Parameters
    ----------
    start
        Starting values near the optimum, from :func:`linear_start`.
    setting
        Lines and out-of-band basis.
    """
    spectra = setting.spectra
    n_unknowns = start.pack().size - 2 * len(start.poles)
    model, converged = start, False
    frf = transfer(model, setting)
    error = spectra.response - prediction(model, setting, frf)
    noise = flat_noise(error, spectra.test, spectra.excitation.shape[1])  # far off, misfit would pass for force noise
    for number in range(_NOISE_ROUNDS):
        if number:
            noise = noise_levels(error, frf, spectra.test, spectra.n_tests, n_unknowns)
        model, frf, error, converged = _gauss_newton(model, setting, noise)
    whitener, log_determinant = _whitener(noise.covariance(frf, spectra.test))
    cost = float(np.sum(np.abs(whitener @ error[..., None]) ** 2))
    information = _information(model, setting, noise, frf, error)
    freedom = spectra.response.size - n_unknowns / 2
    return LikelihoodFit(
        model, _covariance(information, model), noise, cost / freedom, -cost - log_determinant, converged
    )


def _gauss_newton(
    model: LikelihoodModel, setting: Setting, noise: NoiseLevels
) -> tuple[LikelihoodModel, Complex, Complex, bool]:
    """Levenberg-Marquardt steps with noise variances held."""
    damping = 1e-4
    frf, error, cost = _evaluate(model, setting, noise)
    for _ in range(_STEPS):
        weighted, gradient = _normal_equations(model, setting, noise, frf, error)
        scale = np.sqrt(np.maximum(np.diag(weighted), 1e-300))
        matrix, right_side = weighted / np.outer(scale, scale), gradient / scale
        while True:
            step = np.linalg.solve(matrix + (damping + 1e-11) * np.eye(len(matrix)), right_side) / scale
            trial = model.unpack(model.pack() + step)
            if trial.poles.real.max() < 0:
                new_frf, new_error, new_cost = _evaluate(trial, setting, noise)
                if new_cost <= cost:
                    break
            damping *= 10
            if damping > 1e8:
                return model, frf, error, True
        gain = cost - new_cost
        model, frf, error, cost = trial, new_frf, new_error, new_cost
        damping = max(damping / 10, 1e-12)
        if gain < _ENOUGH:
            return model, frf, error, True
    return model, frf, error, False


def _evaluate(model: LikelihoodModel, setting: Setting, noise: NoiseLevels) -> tuple[Complex, Complex, float]:
    frf = transfer(model, setting)
    error = setting.spectra.response - prediction(model, setting, frf)
    whitener, _ = _whitener(noise.covariance(frf, setting.spectra.test))
    return frf, error, float(np.sum(np.abs(whitener @ error[..., None]) ** 2))


def _whitener(covariance: Complex) -> tuple[Complex, float]:
    """Inverse Cholesky factors, shape as given, and the log determinant summed over lines."""
    factor = np.linalg.cholesky(covariance)
    log_determinant = float(2 * np.sum(np.log(np.real(np.einsum("kpp->kp", factor)))))
    return np.asarray(np.linalg.inv(factor), dtype=np.complex128), log_determinant


def _corrected_force(noise: NoiseLevels, spectra: RecordSpectra, frf: Complex, error: Complex) -> Complex:
    """Force freed of its estimated noise, F + W H^H V^-1 e."""
    if not noise.excitation.any():
        return spectra.excitation
    weighted = np.linalg.solve(noise.covariance(frf, spectra.test), error[..., None])[..., 0]
    correction = noise.excitation[spectra.test] * np.einsum("kpq,kp->kq", frf.conj(), weighted)
    return np.asarray(spectra.excitation + correction)


def _normal_equations(
    model: LikelihoodModel, setting: Setting, noise: NoiseLevels, frf: Complex, error: Complex
) -> tuple[Real, Real]:
    force = _corrected_force(noise, setting.spectra, frf, error)
    derivative = jacobian(model, setting, force)
    whitener, _ = _whitener(noise.covariance(frf, setting.spectra.test))
    columns = (whitener @ derivative).reshape(-1, derivative.shape[-1])
    target = (whitener @ error[..., None]).reshape(-1)
    real, imaginary = np.ascontiguousarray(columns.real), np.ascontiguousarray(columns.imag)
    matrix = real.T @ real + imaginary.T @ imaginary
    return np.asarray(matrix), np.asarray(real.T @ target.real + imaginary.T @ target.imag)


def _information(model: LikelihoodModel, setting: Setting, noise: NoiseLevels, frf: Complex, error: Complex) -> Real:
    """Fisher information of the packed unknowns: twice the whitened Jacobian's product (complex noise)."""
    weighted, _ = _normal_equations(model, setting, noise, frf, error)
    return 2 * weighted


def _covariance(information: Real, model: LikelihoodModel) -> Real:
    """Inverse of the information on the complement of the scaling directions."""
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    gauge = gauge_directions(model) / scale[:, None]
    complete, _ = np.linalg.qr(gauge, mode="complete")
    free = complete[:, gauge.shape[1] :] * scale[:, None]
    return np.asarray(free @ np.linalg.inv(free.T @ information @ free) @ free.T)


def linear_start(poles: Complex, setting: Setting, *, transients: bool = True) -> LikelihoodModel:
    """Least-squares unknowns for fixed ``poles`` (rad/s), with residues reduced to rank one.

    Responses of one kind have the same regressors, so one factorisation serves them all. The residue
    matrices come out full and are cut to rank one by their singular vectors, which are the right and left vectors.
    """
    spectra = setting.spectra
    n_modes, n_excitations, n_outside = len(poles), spectra.excitation.shape[1], len(setting.basis)
    n_tests = spectra.n_tests if transients else 0
    parts = []
    for derivative in np.unique(spectra.derivative):
        mine = spectra.derivative == derivative
        parts.append((mine, _solve(regressors(poles, setting, int(derivative), n_tests), spectra.response[:, mine])))
    solution = np.empty((len(parts[0][1]), spectra.response.shape[1]))
    for mine, part in parts:
        solution[:, mine] = part
    ends = np.cumsum([2 * n_modes * n_excitations, n_outside * n_excitations])
    residues, outside, free = np.split(solution, ends)
    residues = residues.reshape(n_modes, n_excitations, 2, -1)
    outside = np.moveaxis(outside.reshape(n_outside, n_excitations, -1), 1, 2)
    free = free.reshape(n_tests, n_modes + len(setting.powers), 2, spectra.response.shape[1])
    decays = free[:, :, 0] + 1j * free[:, :, 1]
    matrices = np.moveaxis(residues[:, :, 0] + 1j * residues[:, :, 1], 1, 2)
    return _rank_one(poles, matrices, outside, decays[:, :n_modes], decays[:, n_modes:])


def regressors(poles: Complex, setting: Setting, derivative: int, n_tests: int) -> Complex:
    """Columns of the linear problem, shape (n_lines, n_unknowns), for real unknowns.

    First the residues, mode by mode and excitation by excitation (real and imaginary part), then the out-of-band terms,
    then the transients of ``n_tests`` tests.
    """
    spectra = setting.spectra
    s, force = spectra.s, spectra.excitation
    factor = s**derivative
    plus = factor[:, None] / (s[:, None] - poles)
    minus = factor[:, None] / (s[:, None] - poles.conj())
    residues = np.einsum("krc,kq->krqc", np.stack([plus + minus, 1j * (plus - minus)], axis=2), force)
    outside = np.einsum("nk,kq->knq", factor * setting.basis, force)
    member = (spectra.test[:, None] == np.arange(n_tests)).astype(float)
    free = np.concatenate([plus, setting.powers.T], axis=1)
    transients = np.einsum("kt,kn,c->ktnc", member, free, np.array([1, 1j]))
    n_lines = len(s)
    blocks = [block.reshape(n_lines, -1) for block in (residues, outside)]
    if n_tests:
        blocks.append(transients.reshape(n_lines, -1))
    return np.concatenate(blocks, axis=1)


def _solve(regressors: Complex, response: Complex) -> NDArray[np.float64]:
    """Real least squares of a complex equation, columns scaled to unit length."""
    design = np.concatenate([regressors.real, regressors.imag])
    target = np.concatenate([response.real, response.imag])
    scale = np.linalg.norm(design, axis=0)
    scale[scale == 0] = 1.0
    return np.asarray(np.linalg.lstsq(design / scale, target, rcond=1e-12)[0] / scale[:, None])


def _rank_one(
    poles: Complex, matrices: Complex, outside: NDArray[np.float64], decays: Complex, smooth: Complex
) -> LikelihoodModel:
    """Cut residue matrices to their leading singular pair and refer the transients to the right vectors."""
    u, sigma, vh = np.linalg.svd(matrices)
    root = np.sqrt(sigma[:, :1])
    right, left = u[:, :, 0] * root, vh[:, 0] * root
    length = np.sum(np.abs(right) ** 2, axis=1)
    transient = np.einsum("trp,rp->tr", decays, right.conj()) / np.where(length > 0, length, 1.0)
    return LikelihoodModel(
        np.asarray(poles, dtype=complex), right, left, np.ascontiguousarray(outside), transient, smooth
    )


def best_fit(
    poles: NDArray[np.complex128],
    spectra: RecordSpectra,
    band: tuple[float, float],
    *,
    n_smooth: int,
) -> LikelihoodFit:
    """Fit without, with one and with two fixed poles above the band; keep the best by Schwarz's criterion.

    Raises
    ------
    MillfrfError
        Neither fit gave finite numbers.
    """
    fits = []
    x = 2 * (spectra.s.imag / (2 * np.pi) - band[0]) / (band[1] - band[0]) - 1
    powers = np.array([x**k for k in range(n_smooth)]).reshape(n_smooth, len(x))
    for above in ABOVE:
        setting = Setting(spectra, out_of_band_basis(spectra.s, band, above), powers)
        try:
            start = linear_start(poles, setting, transients=n_smooth > 0)
            fit = maximise_likelihood(start, setting)
        except np.linalg.LinAlgError:
            continue
        if np.isfinite(fit.log_likelihood):
            fits.append((_criterion(fit, spectra), fit))
    if not fits:
        raise MillfrfError(f"the refinement of {len(poles)} modes did not converge; choose another band or fewer modes")
    return min(fits, key=_first)[1]


def _first(pair: tuple[float, LikelihoodFit]) -> float:
    return pair[0]


def _criterion(fit: LikelihoodFit, spectra: RecordSpectra) -> float:
    n_unknowns = fit.model.pack().size - 2 * len(fit.model.poles)
    return -2 * fit.log_likelihood + n_unknowns * float(np.log(2 * spectra.response.size))


def modal_model_from(
    fit: LikelihoodFit, band: tuple[float, float], responses: Sequence[str], excitations: Sequence[str], unit: str
) -> ModalModel:
    """The modes in order of frequency, with residual terms and the covariance of poles and vectors.

    The covariance is widened by the reduced chi-square where that is above 1: a misfit that the noise does not explain
    is uncertainty too.
    """
    model = fit.model
    order = np.argsort(np.abs(model.poles))
    n_kept = 2 * (model.poles.size + model.right.size + model.left.size)
    covariance = fit.covariance[:n_kept, :n_kept] * max(1.0, fit.reduced_chi_square)
    index = _sorting_index(model, order, n_kept)
    return ModalModel(
        poles=model.poles[order],
        right=model.right[order],
        left=model.left[order],
        responses=tuple(responses),
        excitations=tuple(excitations),
        quantity="receptance" if unit == "m/N" else "transfer",
        unit=unit,
        residuals=residuals_from(model.outside, band),
        covariance=covariance[np.ix_(index, index)],
        band=band,
    )


def _sorting_index(model: LikelihoodModel, order: NDArray[np.int64], n_kept: int) -> NDArray[np.int64]:
    """Give the place in the unsorted model of each packed unknown of the sorted one."""
    numbered = model.unpack(np.arange(model.pack().size, dtype=float))
    moved = replace(numbered, poles=numbered.poles[order], right=numbered.right[order], left=numbered.left[order])
    return moved.pack()[:n_kept].astype(np.int64)
