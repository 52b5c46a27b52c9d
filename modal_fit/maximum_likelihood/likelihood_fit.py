"""Maximum-likelihood modal parameters from whole records, with noisy forces and responses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Band, Complex, Index, MillfrfError, Real

from ..models.modal_model import ModalModel
from ..models.out_of_band import fixed_poles, out_of_band_basis, residuals_from
from ..settings import SETTINGS
from .likelihood_model import LikelihoodModel, LikelihoodProblem, gauge_directions, linear_start, prediction, transfer
from .normal_equations import Evaluation, evaluate, normal_equations
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


@dataclass(frozen=True)
class Optimum:
    """Least cost of the unknowns of one problem, with the noise variances at which it was found."""

    problem: LikelihoodProblem
    at: Evaluation
    noise: NoiseLevels
    converged: bool

    @property
    def log_likelihood(self) -> float:
        """Return the logarithm of the likelihood, up to a constant."""
        return -self.at.cost - self.at.weights.log_determinant

    @property
    def criterion(self) -> float:
        """Return Schwarz's criterion: the smallest value belongs to the best problem."""
        n_values = 2 * self.problem.spectra.response.size
        return -2 * self.log_likelihood + self.at.model.n_free * float(np.log(n_values))

    def fit(self) -> LikelihoodFit:
        """Return the fit with its covariance, from the Fisher information of complex noise."""
        information = 2 * normal_equations(self.problem, self.noise, self.at)[0]
        model = self.at.model
        freedom = self.problem.spectra.response.size - model.n_free / 2
        chi_square = self.at.cost / freedom
        return LikelihoodFit(
            model, _covariance(information, model), self.noise, chi_square, self.log_likelihood, self.converged
        )


def maximise_likelihood(start: LikelihoodModel, problem: LikelihoodProblem) -> Optimum:
    """Fit all unknowns to the lines of all tests at once, with noise on forces and responses.

    The cost is ``sum_k e^H V^-1 e`` with ``e = X - prediction`` and ``V = diag(response noise) + H diag(force
    noise) H^H``. Its gradient is taken at the force corrected for its estimated error, ``F + W H^H V^-1 e``, which
    removes the bias that noise on nearly dependent forces brings into H1 (Pintelon & Schoukens, System Identification,
    2nd ed., section 9.11). Variances of the noise and the unknowns are estimated alternately. ``start`` must lie near
    the optimum; see :func:`linear_start`.
    """
    spectra = problem.spectra
    error = problem.response - prediction(start, problem, transfer(start, problem))
    # far from the optimum, the misfit would be taken for noise of the forces
    optimum = _optimum(start, problem, flat_noise(error, spectra))
    for _ in range(1, SETTINGS.noise_rounds):
        noise = noise_levels(optimum.at.error, optimum.at.frf, spectra, start.n_free)
        optimum = _optimum(optimum.at.model, problem, noise)
    return optimum


def _optimum(start: LikelihoodModel, problem: LikelihoodProblem, noise: NoiseLevels, reach: float = np.inf) -> Optimum:
    """Take Levenberg-Marquardt steps with fixed noise variances.

    Only the poles, left vectors and transients are damped. The unknowns in which the response is linear follow without
    damping, so that the steps are those of variable projection with Kaufman's Jacobian (Golub & Pereyra 1973; Ruhe &
    Wedin, SIAM Review 22, 1980). The steps end where the linearised problem has no cost below ``reach``.
    """
    damping = SETTINGS.first_step_damping
    damped = _nonlinear(start)
    at = evaluate(start, problem, noise)
    for _ in range(SETTINGS.likelihood_steps):
        weighted, gradient = normal_equations(problem, noise, at)
        scale = np.sqrt(np.maximum(np.diag(weighted), 1e-300))
        matrix, right_side = weighted / np.outer(scale, scale), gradient / scale
        # 1e-11 keeps the matrix regular: the scaling of each pair of vectors is free
        matrix[np.diag_indices_from(matrix)] += 1e-11
        if at.cost - right_side @ np.linalg.solve(matrix, right_side) > reach:
            return Optimum(problem, at, noise, False)
        while True:
            step = np.linalg.solve(matrix + damping * np.diag(damped), right_side) / scale
            trial = at.model.unpack(at.model.pack() + step)
            if trial.poles.real.max() < 0:
                after = evaluate(trial, problem, noise)
                if after.cost <= at.cost:
                    break
            damping *= 10
            if damping > SETTINGS.largest_step_damping:
                return Optimum(problem, at, noise, True)
        gain = at.cost - after.cost
        at = after
        damping = max(damping / 10, 1e-12)
        if gain < SETTINGS.likelihood_gain:
            return Optimum(problem, at, noise, True)
    return Optimum(problem, at, noise, False)


def _nonlinear(model: LikelihoodModel) -> Real:
    """Return 1 for the packed unknowns in which the response is not linear, else 0."""
    marked = model.unpack(np.zeros(model.pack().size))
    for array in (marked.poles, marked.left, marked.transient):
        array[...] = 1 + 1j
    return marked.pack()


def _covariance(information: Real, model: LikelihoodModel) -> Real:
    """Invert the Fisher information on all directions except the scalings that change no prediction."""
    scale = 1 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    gauge = gauge_directions(model) / scale[:, None]
    complete, _ = np.linalg.qr(gauge, mode="complete")
    free = complete[:, gauge.shape[1] :] * scale[:, None]
    return np.asarray(free @ np.linalg.inv(free.T @ information @ free) @ free.T)


def best_fit(poles: Complex, spectra: RecordSpectra, band: Band) -> tuple[LikelihoodFit, list[complex]]:
    """Fit with no, one and two fixed poles above the band; keep the best fit by Schwarz's criterion.

    The most poles are fitted first. Fewer are fitted only where, with the noise of the best fit so far, the criterion
    shows that they may suffice.

    Returns the fit and its fixed poles, rad/s.

    Raises
    ------
    MillfrfError
        No fit gave finite numbers.
    """
    best: tuple[Optimum, list[complex]] | None = None
    x = 2 * (spectra.s.imag / (2 * np.pi) - band[0]) / (band[1] - band[0]) - 1
    powers = np.array([x**k for k in range(SETTINGS.transient_terms)])
    for above in reversed(SETTINGS.poles_above_band):
        fixed = fixed_poles(band, (), above)
        problem = LikelihoodProblem(spectra, out_of_band_basis(spectra.s, band, fixed), powers)
        try:
            if best is not None and not _may_suffice(problem, best[0]):
                continue
            optimum = maximise_likelihood(linear_start(poles, problem), problem)
        except np.linalg.LinAlgError:  # the normal matrix is singular with these terms
            continue
        if np.isfinite(optimum.criterion) and (best is None or optimum.criterion <= best[0].criterion):
            best = optimum, fixed
    if best is None:
        raise MillfrfError(f"the refinement of {len(poles)} modes did not converge; choose another band or fewer modes")
    return best[0].fit(), best[1]


def _may_suffice(problem: LikelihoodProblem, best: Optimum) -> bool:
    """Return whether a problem has a smaller criterion than the best one so far, with the noise of the best one.

    The steps start at the poles of the best one, where the linearised problem is accurate if the problem suffices.
    """
    start = linear_start(best.at.model.poles, problem)
    n_values = 2 * problem.spectra.response.size
    spared = (best.at.model.n_free - start.n_free) * float(np.log(n_values)) / 2
    trial = _optimum(start, problem, best.noise, reach=best.at.cost + spared)
    return trial.criterion < best.criterion


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
