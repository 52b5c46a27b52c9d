"""Maximum-likelihood modal parameters from whole records, with noisy forces and responses."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Band, Complex, Index, MillfrfError, Real

from ..models.modal_model import ModalModel
from ..models.out_of_band import fixed_poles, out_of_band_basis, residuals_from
from ..settings import SETTINGS
from .likelihood_model import LikelihoodModel, LikelihoodProblem, gauge_directions, linear_start, prediction, transfer
from .normal_equations import Evaluation, evaluate, force_noise_information, gradient, normal_equations
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
        """Return the fit with its covariance."""
        model = self.at.model
        freedom = self.problem.spectra.response.size - model.n_free / 2
        chi_square = self.at.cost / freedom
        return LikelihoodFit(model, _covariance(self), self.noise, chi_square, self.log_likelihood, self.converged)


def maximise_likelihood(start: LikelihoodModel, problem: LikelihoodProblem) -> Optimum:
    """Fit all unknowns to the lines of all tests at once, with noise on forces and responses.

    The cost is ``sum_k e^H V^-1 e`` with ``e = X - prediction`` and ``V = diag(response noise) + H diag(force
    noise) H^H``. Its gradient is taken at the force corrected for its estimated error, ``F + W H^H V^-1 e``, which
    removes the bias that noise on nearly dependent forces brings into H1 (Pintelon & Schoukens, System Identification,
    2nd ed., section 9.11). Variances of the noise and the unknowns are estimated alternately, until they hardly move.
    Where a mode is missing, noise of the forces would hide any misfit: if flat noise of the responses is likelier, it
    is returned. ``start`` must lie near the optimum; see :func:`linear_start`.
    """
    return _finished(_with_likely_noise(start, problem))


def _with_likely_noise(start: LikelihoodModel, problem: LikelihoodProblem) -> Optimum:
    """Estimate the noise variances, with unknowns that are near the optimum."""
    # far from the optimum, the misfit would be taken for noise of the forces
    first = _with_flat_noise(start, problem)
    optimum = _with_own_noise(first)
    return optimum if optimum.log_likelihood > first.log_likelihood else first


def _with_own_noise(optimum: Optimum) -> Optimum:
    """Estimate noise variances and unknowns alternately until they hardly move."""
    problem = optimum.problem
    for _ in range(SETTINGS.noise_rounds):
        noise = noise_levels(optimum.at.error, optimum.at.frf, problem.spectra, optimum.at.model.n_free)
        before = evaluate(optimum.at.model, problem, noise).cost
        optimum = _optimum(optimum.at.model, problem, noise, steps=SETTINGS.steps_of_round)
        if before - optimum.at.cost < SETTINGS.likelihood_gain * optimum.at.model.n_free:
            break
    return optimum


def _finished(optimum: Optimum) -> Optimum:
    """Take the last steps, with the noise variances as they are."""
    return _optimum(optimum.at.model, optimum.problem, optimum.noise)


def _with_flat_noise(start: LikelihoodModel, problem: LikelihoodProblem) -> Optimum:
    """Return the optimum with the misfit as flat noise of the responses, and its likelihood with this noise."""
    spectra = problem.spectra
    error = problem.response - prediction(start, problem, transfer(start, problem))
    optimum = _optimum(start, problem, flat_noise(error, spectra))
    noise = flat_noise(optimum.at.error, spectra)
    return replace(optimum, at=evaluate(optimum.at.model, problem, noise), noise=noise)


def _optimum(
    start: LikelihoodModel,
    problem: LikelihoodProblem,
    noise: NoiseLevels,
    reach: float = np.inf,
    steps: int = SETTINGS.likelihood_steps,
) -> Optimum:
    """Take Levenberg-Marquardt steps with fixed noise variances.

    Only the poles, left vectors and transients are damped. The unknowns in which the response is linear follow without
    damping, so that the steps are those of variable projection with Kaufman's Jacobian (Golub & Pereyra 1973; Ruhe &
    Wedin, SIAM Review 22, 1980). The steps end where the linearised problem has no cost below ``reach``.
    """
    damping, least = SETTINGS.first_step_damping, 0.1
    damped = _nonlinear(start)
    at = evaluate(start, problem, noise)
    by_noise = force_noise_information(problem, noise, at)  # it hardly changes on the way to the optimum
    for _ in range(steps):
        weighted, slope = normal_equations(problem, noise, at)
        free = _free_directions(at.model, weighted)
        matrix, right_side = free.T @ weighted @ free, free.T @ slope
        held = (free.T * damped * np.diag(weighted)) @ free
        shares, root, _ = _noise_shares(matrix, free.T @ by_noise @ free)
        promised = float(right_side @ np.linalg.solve(_without(matrix, shares, root), right_side))
        if at.cost - promised > reach:
            return Optimum(problem, at, noise, False)
        while True:
            damped_matrix = _without(matrix, shares, root, least) + damping * held
            step = free @ np.linalg.solve(damped_matrix, right_side)
            after = _lower(problem, noise, at, step)
            if after is None:
                bend = free @ np.linalg.solve(damped_matrix, free.T @ _bending(problem, noise, at, step))
                after = _lower(problem, noise, at, step + bend)
            if after is not None:
                break
            damping, least = 10 * damping, min(1.0, 3 * least)
            if damping > SETTINGS.largest_step_damping:
                return Optimum(problem, at, noise, True)
        gain = at.cost - after.cost
        at = after
        damping, least = max(damping / 10, 1e-12), max(least / 3, 1 - SETTINGS.largest_noise_share)
        if min(gain, promised) < SETTINGS.likelihood_gain:
            return Optimum(problem, at, noise, True)
    return Optimum(problem, at, noise, False)


def _lower(problem: LikelihoodProblem, noise: NoiseLevels, at: Evaluation, step: Real) -> Evaluation | None:
    """Evaluate the model after a step; None if the cost rises or a pole becomes unstable."""
    trial = at.model.unpack(at.model.pack() + step)
    after = evaluate(trial, problem, noise) if trial.poles.real.max() < 0 else None
    return None if after is None or not after.cost <= at.cost else after


def _bending(problem: LikelihoodProblem, noise: NoiseLevels, at: Evaluation, step: Real) -> Real:
    """Return the slope, by the unknowns, of half the second derivative of the error along a step.

    With it the step follows a curved valley of nearly undetermined unknowns, which a straight one leaves (geodesic
    acceleration; Transtrum & Sethna, arXiv:1201.5885).
    """
    part, ends = 0.1, []
    for move in (part, -part):
        model = at.model.unpack(at.model.pack() + move * step)
        ends.append(problem.response - prediction(model, problem, transfer(model, problem)))
    curvature = (ends[0] - 2 * at.error + ends[1]) / part**2
    return gradient(problem, noise, at, curvature) / 2


def _nonlinear(model: LikelihoodModel) -> Real:
    """Return 1 for the packed unknowns in which the response is not linear, else 0."""
    marked = model.unpack(np.zeros(model.pack().size))
    for array in (marked.poles, marked.left, marked.transient):
        array[...] = 1 + 1j
    return marked.pack()


def _covariance(optimum: Optimum) -> Real:
    """Return the covariance of the packed unknowns, zero along the scalings that change no prediction.

    The gradient's covariance is half the matrix M of the normal equations. Noise of the corrected forces adds D to M,
    but nothing to the mean curvature M - D, so that errors are ``(M - D)^-1 M (M - D)^-1 / 2``.
    """
    matrix = normal_equations(optimum.problem, optimum.noise, optimum.at)[0]
    free = _free_directions(optimum.at.model, matrix)
    by_noise = free.T @ force_noise_information(optimum.problem, optimum.noise, optimum.at) @ free
    shares, _, white = _noise_shares(free.T @ matrix @ free, by_noise)
    # a product with its transpose has no negative variances, even where two modes are nearly equal
    factor = free @ (white / (1 - np.minimum(shares, SETTINGS.largest_noise_share)))
    return np.asarray(factor @ factor.T / 2)


def _free_directions(model: LikelihoodModel, matrix: Real) -> Real:
    """Return the directions that are no scalings of vectors, as columns scaled to the diagonal of a matrix."""
    scale = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    gauge = gauge_directions(model) / scale[:, None]
    complete, _ = np.linalg.qr(gauge, mode="complete")
    return np.asarray(complete[:, gauge.shape[1] :] * scale[:, None])


def _noise_shares(matrix: Real, by_noise: Real) -> tuple[Real, Real, Real]:
    """Return ``shares``, ``root`` and ``white``: ``matrix = root root^T``, ``by_noise = root diag(shares) root^T``.

    ``white`` is the inverse of the transposed root, so that ``white white^T`` is the inverse of the matrix.
    """
    values, vectors = np.linalg.eigh(matrix)
    size = np.sqrt(np.maximum(values, 1e-11 * values[-1]))
    shares, directions = np.linalg.eigh((vectors / size).T @ by_noise @ (vectors / size))
    return shares, (vectors * size) @ directions, (vectors / size) @ directions


def _without(matrix: Real, shares: Real, root: Real, least: float = 1 - SETTINGS.largest_noise_share) -> Real:
    """Subtract what noise adds to a matrix, but leave at least a share of it in each direction."""
    return np.asarray(matrix - root * np.minimum(shares, 1 - least) @ root.T)


def weakest_mode(fit: LikelihoodFit, among: Sequence[int], n_values: int) -> tuple[int, bool]:
    """Return which of some modes has the smallest residue over its error, and whether Schwarz's criterion needs it.

    Wald's statistic ``a^T C^-1 a`` of the residue a is what the criterion's misfit would rise by without the mode; it
    has to exceed ``ln n`` for each of the mode's real unknowns, with ``n_values`` real values fitted.
    """
    model = fit.model
    n_responses, n_excitations = model.right.shape[1], model.left.shape[1]
    n_free = 2 * (n_responses + n_excitations) - 2  # of a residue matrix of rank one
    places = model.places()
    statistics = []
    for r in among:
        right, left = (
            np.kron(np.eye(n_responses), model.left[r][:, None]),
            np.tile(np.eye(n_excitations), (n_responses, 1)),
        )
        left = left * np.repeat(model.right[r], n_excitations)[:, None]
        slopes = np.hstack([right, 1j * right, left, 1j * left])
        parts = (places.right[r].real, places.right[r].imag, places.left[r].real, places.left[r].imag)
        own = np.concatenate(parts).astype(np.int64)
        jacobian = np.vstack([slopes.real, slopes.imag])
        covariance = jacobian @ fit.covariance[np.ix_(own, own)] @ jacobian.T
        residue = np.outer(model.right[r], model.left[r]).ravel()
        scale = np.sqrt(np.diag(covariance))
        values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
        along = vectors[:, -n_free:].T @ (np.concatenate([residue.real, residue.imag]) / scale)
        statistics.append(float(np.sum(along**2 / values[-n_free:])))
    weakest = int(np.argmin(statistics))
    return among[weakest], statistics[weakest] > (n_free + 2) * np.log(n_values)


def best_fit(poles: Complex, spectra: RecordSpectra, band: Band) -> tuple[LikelihoodFit, list[complex]]:
    """Fit with three to no fixed poles outside the band; return the best fit by Schwarz's criterion.

    The noise is that of the fit with the most poles: with too few, errors of the model would be taken for noise. The
    best is fitted to the end, without those modes that start outside the band and that the criterion does not need.

    Returns the fit and its fixed poles, rad/s.

    Raises
    ------
    MillfrfError
        No fit gave finite numbers.
    """
    first, best = None, None
    fixed: list[complex] = []
    x = 2 * (spectra.s.imag / (2 * np.pi) - band[0]) / (band[1] - band[0]) - 1
    powers = np.array([x**k for k in range(SETTINGS.transient_terms)])
    for below, above in reversed(SETTINGS.poles_outside_band):
        outside = fixed_poles(band, below, above)
        problem = LikelihoodProblem(spectra, out_of_band_basis(spectra.s, band, outside), powers)
        try:
            if first is None or best is None:
                optimum = _with_likely_noise(linear_start(poles, problem), problem)
                first = optimum if np.isfinite(optimum.criterion) else None
            else:
                optimum = _with_noise_of(first, problem, best.criterion)
        except np.linalg.LinAlgError:  # the normal matrix is singular with these terms
            continue
        if np.isfinite(optimum.criterion) and (best is None or optimum.criterion <= best.criterion):
            best, fixed = optimum, outside
    if best is None:
        raise MillfrfError(f"the refinement of {len(poles)} modes did not converge; choose another band or fewer modes")
    hertz = np.abs(poles) / (2 * np.pi)
    needed = _with_needed_modes(best, np.flatnonzero((hertz <= band[0]) | (hertz >= band[1])).tolist())
    return _finished(needed if needed is first else _with_own_noise(needed)).fit(), fixed


def _with_needed_modes(optimum: Optimum, spare: Sequence[int]) -> Optimum:
    """Leave out modes among the ``spare`` ones, one at a time, as long as the criterion falls.

    The poles of such modes may be undetermined: then no steps converge, and the errors of the others are not theirs.
    """
    problem, poles = optimum.problem, optimum.at.model.poles
    if not 0 < len(spare) < len(poles):
        return optimum
    weakest, needed = weakest_mode(optimum.fit(), spare, 2 * problem.spectra.response.size)
    if needed:
        return optimum
    start = linear_start(np.delete(poles, weakest), problem)
    fewer = _optimum(start, problem, optimum.noise, steps=2 * SETTINGS.steps_of_round)
    others = [mode - (mode > weakest) for mode in spare if mode != weakest]
    return optimum if fewer.criterion > optimum.criterion else _with_needed_modes(fewer, others)


def _with_noise_of(first: Optimum, problem: LikelihoodProblem, least: float) -> Optimum:
    """Fit another problem with the noise of the first, as long as its criterion may fall below the least so far.

    The steps start at the first one's poles, where the linearised problem is accurate if the problem suffices.
    """
    start = linear_start(first.at.model.poles, problem)
    penalty = start.n_free * float(np.log(2 * problem.spectra.response.size))
    return _optimum(start, problem, first.noise, reach=(least - penalty) / 2 - first.at.weights.log_determinant)


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
    lower = fit.model.poles.imag < 0
    model = _conjugated(fit.model, lower)
    order = np.argsort(np.abs(model.poles))
    n_parameters = 2 * (model.poles.size + model.right.size + model.left.size)
    signs = _conjugated(model.unpack(np.ones(model.pack().size)), lower).pack()[:n_parameters]
    covariance = fit.covariance[:n_parameters, :n_parameters] * np.outer(signs, signs)
    covariance *= max(1.0, fit.reduced_chi_square)
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


def _conjugated(model: LikelihoodModel, modes: NDArray[np.bool_]) -> LikelihoodModel:
    """Describe some modes by the other pole of their pair; ``A / (s - p) + A* / (s - p*)`` remains the same.

    A pole near the real axis, of a mode with critical damping, may cross it between two steps of the fit.
    """
    poles, right, left = (
        np.where(modes.reshape(-1, *[1] * (part.ndim - 1)), part.conj(), part)
        for part in (model.poles, model.right, model.left)
    )
    return replace(model, poles=poles, right=right, left=left)


def _sorting_index(model: LikelihoodModel, order: Index) -> Index:
    """Return the place that each packed unknown of the sorted model has in the unsorted model."""
    numbered = model.unpack(np.arange(model.pack().size, dtype=float))
    ordered = replace(numbered, poles=numbered.poles[order], right=numbered.right[order], left=numbered.left[order])
    return ordered.pack().astype(np.int64)
