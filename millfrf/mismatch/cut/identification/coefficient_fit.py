"""Fit of force coefficients, runout and spindle angles to the spindle orders of several cuts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Complex, Index, Real

from .cut_forces import CutForces
from .force_problem import ForceProblem, evenly_weighted, inverse_square, mean_problem

ROUNDS = 3  # of weighting by the misfit
LEAST_LEFT_OUT = 3  # cuts from which each is left out in turn
ANGLE_STEP = 1e-3  # rad; of the differences for the error bars
RUNOUT_STEP = 0.02  # of the largest feed, likewise


@dataclass(frozen=True)
class CoefficientFit:
    """Result of a fit.

    Parameters
    ----------
    coefficients : (6,), Pa and N/m
        ``Ktc, Krc, Kac, Kte, Kre, Kae``; NaN where no measured axis shows one.
    covariance : (6, 6)
        Of ``coefficients``, from the misfit and the noise.
    runout : m
        Components of the radial offset: the radius of tooth j is larger by
        ``a cos(2 pi j / N) + b sin(2 pi j / N)``.
    runout_error : m
        Standard errors of both.
    runout_chance
        Probability of so large a runout where there is none (F-test with the covariance of both); 1 for one tooth.
    angles : (n_cuts,), rad
        Angle of tooth 0 at which each recording's orders begin.
    fitted : tuple of (n_orders, n_axes), N
        Computed Fourier coefficients of each cut.
    misfit
        Root mean square of the difference over that of the forces.
    residual_power : N^2
        Sum of the squared, weighted differences.
    freedom
        Number of real data minus that of parameters.
    """

    coefficients: Real
    covariance: Real
    runout: tuple[float, float]
    runout_error: tuple[float, float]
    runout_chance: float
    angles: Real
    fitted: tuple[Complex, ...]
    misfit: float
    residual_power: float
    freedom: int


def fit_mean_forces(cuts: Sequence[CutForces]) -> tuple[Real, Real]:
    """Fit the coefficients to the mean forces alone (Altintas, Manufacturing Automation, 2nd ed., section 2.8.2).

    Runout does not change the mean while every tooth cuts, and no angle is needed.

    Returns
    -------
    coefficients : (6,)
        NaN where no measured axis shows one.
    covariance : (6, 6)

    Raises
    ------
    InputError
        The cuts do not separate the coefficients, as with a single feed.
    """
    problem, still = mean_problem(cuts)
    return problem.solved(*still)


def fit_cuts(cuts: Sequence[CutForces], moved: Sequence[Sequence[CutForces]] = ()) -> CoefficientFit:
    """Fit coefficients, runout and angles to all orders of the forces.

    The six coefficients are linear in the forces and eliminated; runout and the angle of tooth 0 in each recording are
    searched over a grid and refined. Weights are the inverse of misfit and noise together; the mean of a recording
    whose zero drifts counts accordingly less.

    Parameters
    ----------
    cuts
        Forces of the cuts, at least one.
    moved
        The same cuts with the transfer of the dynamometer changed by one standard step of each of its parameters, if
        it was fitted to them: the error bars then include these.

    Raises
    ------
    InputError
        The cuts do not separate the coefficients.
    """
    problem = evenly_weighted(cuts)
    refined = [problem.refined(start) for start in problem.starts()]
    best = min(refined, key=problem.misfit)
    for _ in range(ROUNDS):
        problem = problem.reweighted(best)
        best = problem.refined(best)
    return _result(problem, best, moved)


def grid_misfit(cuts: Sequence[CutForces]) -> float:
    """Return the weighted misfit at the best point of the grid, with the coefficients of the mean forces."""
    return evenly_weighted(cuts).ranked()[0][0]


def _result(problem: ForceProblem, at: tuple[Real, Real], moved: Sequence[Sequence[CutForces]]) -> CoefficientFit:
    """Return the fit with error bars that include angles, runout and an inferred transfer."""
    angles, runout = at
    basis, orders = problem.spectra(runout), problem.orders
    design = problem.design(basis, angles)
    problem.require_separated(design)
    solution, residual = problem.solve(design)
    columns = [design, _nonlinear_columns(problem, at, solution)]
    for changed in moved:
        other = replace(problem, cuts=changed).spectra(runout)
        columns.append(((problem.design(other, angles) - design) @ solution)[:, None])
    jacobian = np.column_stack(columns)
    freedom = max(len(residual) - jacobian.shape[1], 1)
    covariance = max(float(residual @ residual) / freedom, 1.0) * inverse_square(jacobian)
    covariance = _at_least_between_cuts(covariance, jacobian, residual, len(problem.cuts))
    k, offset_errors, n = len(solution), np.zeros(2), problem.n_offsets
    block = covariance[k + len(angles) :, k + len(angles) :][:n, :n]
    offset_errors[:n] = np.sqrt(np.diag(block))
    ratio = float(runout[:n] @ np.linalg.pinv(block) @ runout[:n]) / max(n, 1)
    chance = float(scipy.stats.f.sf(ratio, n, freedom)) if n else 1.0
    fitted = tuple(
        np.tensordot(solution, spectra, 1) * np.exp(1j * orders * angle)[:, None]
        for spectra, angle in zip(basis, angles, strict=True)
    )
    power = rest = 0.0
    for cut, computed in zip(problem.cuts, fitted, strict=True):
        power += _power(cut.mean[orders], orders)
        rest += _power(cut.mean[orders] - computed, orders)
    return CoefficientFit(
        problem.filled(solution), problem.filled_square(covariance[:k, :k]),
        (float(runout[0]), float(runout[1])), (float(offset_errors[0]), float(offset_errors[1])), chance,
        np.mod(angles, 2 * np.pi), fitted, float(np.sqrt(rest / power)), rest, freedom,
    )  # fmt: skip


def _at_least_between_cuts(covariance: Real, jacobian: Real, residual: Real, n_cuts: int) -> Real:
    """Return the covariance with variances no smaller than the scatter when each cut is left out in turn.

    The differences of one cut have a common cause, such as a tilt of the cutter, and do not average out as noise does.
    The parameters without a cut are those of the linearised problem (jackknife).
    """
    if n_cuts < LEAST_LEFT_OUT:
        return covariance
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
    unit = jacobian / scale
    moved = []
    for rows in np.split(np.arange(len(residual)), n_cuts):
        # the angle of a cut that is left out is undetermined and stays
        others = np.linalg.pinv(unit.T @ unit - unit[rows].T @ unit[rows], rcond=1e-10)
        moved.append(others @ unit[rows].T @ residual[rows] / scale)
    scatter = (n_cuts - 1) / n_cuts * np.sum((np.array(moved) - np.mean(moved, axis=0)) ** 2, axis=0)
    spread = np.sqrt(np.maximum(scatter / np.maximum(np.diag(covariance), 1e-300), 1.0))
    return np.asarray(covariance * np.outer(spread, spread))


def _nonlinear_columns(problem: ForceProblem, at: tuple[Real, Real], solution: Real) -> Real:
    """Return the derivative of the weighted forces with respect to angles and runout, by differences."""
    angles, runout = at
    basis = problem.spectra(runout)
    still, columns = problem.design(basis, angles), []
    for number in range(len(angles)):
        moved = angles + ANGLE_STEP * (np.arange(len(angles)) == number)
        columns.append((problem.design(basis, moved) - still) @ solution / ANGLE_STEP)
    step = RUNOUT_STEP * problem.largest_feed
    for component in range(problem.n_offsets):
        moved = runout + step * (np.arange(2) == component)
        columns.append((problem.design(problem.spectra(moved), angles) - still) @ solution / step)
    return np.array(columns).T


def _power(values: Complex, orders: Index) -> float:
    return float(np.sum(np.where(orders > 0, 2.0, 1.0)[:, None] * np.abs(values) ** 2))
