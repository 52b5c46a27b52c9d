"""Maximum-likelihood modal parameters from the records themselves: forces noisy, leakage modelled."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .likelihood_model import (
    LikelihoodModel,
    Setting,
    gauge_directions,
    jacobian,
    prediction,
    transfer,
)
from .noise_levels import NoiseLevels, flat_noise, noise_levels
from .whole_records import RecordSpectra

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]
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
