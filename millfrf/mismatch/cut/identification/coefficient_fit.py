"""Fit of force coefficients, runout and spindle angles to the spindle orders of several cuts."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import Complex, Index, Real

from .cut_forces import CutForces
from .force_problem import EDGES, At, ForceLaw, ForceProblem, evenly_weighted, inverse_square, mean_problem
from .turn_model import CONSTANT

ROUNDS = 3  # of weighting by the misfit
ANGLE_STEP = 1e-3  # rad; of the differences for the error bars
RUNOUT_STEP = 0.02  # of the largest feed, likewise
EXPONENT_STEP = 1e-3  # likewise
FIRST_EXPONENT = 0.25  # from which exponents are searched: Kienzle's of steels


@dataclass(frozen=True)
class CoefficientFit:
    """Result of a fit.

    Parameters
    ----------
    coefficients : (6,), Pa and N/m
        ``Ktc, Krc, Kac, Kte, Kre, Kae``; NaN where no measured axis shows one.
    exponents : (3,)
        Exponents of the chip thickness of ``Ktc, Krc, Kac``; 0 where they are not fitted.
    reference : m
        Chip thickness at which the coefficients hold; with exponents that at which the errors of ``Ktc`` and of its
        exponent are independent.
    covariance : (9, 9)
        Of ``coefficients`` and ``exponents``, from the misfit and the noise.
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
        Root mean square of the difference over that of the forces; of means beyond the drift of their zero.
    residual_power : N^2
        Sum of the squared differences.
    freedom
        Number of real data minus that of parameters.
    """

    coefficients: Real
    exponents: Real
    reference: float
    covariance: Real
    runout: tuple[float, float]
    runout_error: tuple[float, float]
    runout_chance: float
    angles: Real
    fitted: tuple[Complex, ...]
    misfit: float
    residual_power: float
    freedom: int


def fit_mean_forces(
    cuts: Sequence[CutForces], law: ForceLaw = EDGES, exponents: Real = CONSTANT, reference: float = 1e-3
) -> tuple[Real, Real]:
    """Fit the coefficients to the mean forces alone (Altintas, Manufacturing Automation, 2nd ed., section 2.8.2).

    Runout does not change the mean while every tooth cuts and coefficients are constant, and no angle is needed.
    Exponents (3,) are given, and the chip thickness (m) at which the coefficients hold.

    Returns
    -------
    coefficients : (6,)
        NaN where no measured axis shows one.
    covariance : (9, 9)

    Raises
    ------
    InputError
        The cuts do not separate the coefficients, as with a single feed.
    """
    problem, still = mean_problem(cuts, law, exponents, reference)
    return problem.solved(still)


def fit_cuts(
    cuts: Sequence[CutForces],
    moved: Sequence[Sequence[CutForces]] = (),
    *,
    law: ForceLaw = EDGES,
    near: CoefficientFit | None = None,
) -> CoefficientFit:
    """Fit coefficients, exponents, runout and angles to all orders of the forces.

    The six coefficients are linear in the forces and eliminated; runout and the angle of tooth 0 in each recording are
    searched over a grid and refined, exponents from Kienzle's of steels on. Weights are the inverse of misfit and noise
    together; the mean of a recording whose zero drifts counts accordingly less.

    Parameters
    ----------
    cuts
        Forces of the cuts, at least one.
    moved
        The same cuts with the transfer of the dynamometer changed by one standard step of each of its parameters, if
        it was fitted to them: the error bars then include these.
    law
        What is fitted besides the cutting coefficients.
    near
        Fit of another law to the same cuts, whose angles and runout are refined; None: those of the grid.

    Raises
    ------
    InputError
        The cuts do not separate the coefficients.
    """
    return fit_at(*fitted_problem(cuts, law, near), moved)


def fitted_problem(
    cuts: Sequence[CutForces], law: ForceLaw, near: CoefficientFit | None = None
) -> tuple[ForceProblem, At]:
    """Return the problem with the weights of its misfit, and the unknowns of its solution."""
    problem = replace(evenly_weighted(cuts), law=law)
    problem = replace(problem, reference=problem.largest_feed)
    starts = problem.starts() if near is None else [At(near.angles, np.array(near.runout))]
    if law.has_exponents:
        starts = [start._replace(exponents=np.where(np.isin(range(3), problem.bent), FIRST_EXPONENT, 0.0))
                  for start in starts]  # fmt: skip
    best = min((problem.refined(start) for start in starts), key=problem.misfit)
    for _ in range(ROUNDS):
        problem = problem.reweighted(best)
        best = problem.refined(best)
    return problem, best


def grid_misfit(cuts: Sequence[CutForces]) -> float:
    """Return the weighted misfit at the best point of the grid, with the coefficients of the mean forces."""
    return evenly_weighted(cuts).ranked()[0][0]


def fit_at(problem: ForceProblem, at: At, moved: Sequence[Sequence[CutForces]]) -> CoefficientFit:
    """Return the fit of a problem solved without tilt, which is refined with a tilt of the cutter's axis.

    Error bars include angles, runout, tilt, exponents and an inferred transfer.
    """
    problem.require_separated(problem.design_at(at))
    if problem.n_offsets:
        at = problem.refined(at._replace(tilt=np.zeros(2)))
        problem = problem.reweighted(at)
    basis, orders = problem.spectra(at.runout, at.exponents, at.tilt), problem.orders
    design = problem.design(basis, at.angles)
    problem.require_separated(design)
    solution, residual = problem.solve(design)
    columns = [design, *_nonlinear_columns(problem, at, solution)]
    for changed in moved:
        other = replace(problem, cuts=changed).spectra(at.runout, at.exponents, at.tilt)
        columns.append(((problem.design(other, at.angles) - design) @ solution)[:, None])
    jacobian = np.column_stack(columns)
    freedom = max(len(residual) - jacobian.shape[1], 1)
    covariance = max(float(residual @ residual) / freedom, 1.0) * inverse_square(jacobian)
    k, bent, n = len(solution), len(problem.bent), problem.n_offsets
    offsets, offset_errors = slice(k + bent, k + bent + n), np.zeros(2)
    block = covariance[offsets, offsets]
    offset_errors[:n] = np.sqrt(np.diag(block))
    ratio = float(at.runout[:n] @ np.linalg.pinv(block) @ at.runout[:n]) / max(n, 1)
    chance = float(scipy.stats.f.sf(ratio, n, freedom)) if n else 1.0
    fitted = tuple(
        np.tensordot(solution, spectra, 1) * np.exp(1j * orders * angle)[:, None]
        for spectra, angle in zip(basis, at.angles, strict=True)
    )
    power = rest = 0.0
    for cut, computed in zip(problem.cuts, fitted, strict=True):
        power += _power(cut.mean[orders], orders)
        rest += _power(_beyond_drift(cut.mean[orders] - computed, cut.drift), orders)
    numbers = [*problem.known, *(6 + index for index in problem.bent)]
    coefficients = problem.filled(solution)
    whole = problem.filled_square(covariance[: k + bent, : k + bent], numbers)
    coefficients, reference, whole = _at_pivot(coefficients, at.exponents, problem.reference, whole)
    return CoefficientFit(
        coefficients, at.exponents, reference, whole,
        (float(at.runout[0]), float(at.runout[1])), (float(offset_errors[0]), float(offset_errors[1])), chance,
        np.mod(at.angles, 2 * np.pi), fitted, float(np.sqrt(rest / power)), rest, freedom,
    )  # fmt: skip


def _at_pivot(coefficients: Real, exponents: Real, reference: float, covariance: Real) -> tuple[Real, float, Real]:
    """Return coefficients, reference (m) and covariance at the chip at which Ktc and its exponent are independent.

    ``K(h) = K (h / h_0)^-m``, so that ``var log K(h)`` is least where ``log(h / h_0) = cov(log K, m) / var(m)``.
    """
    if not covariance[6, 6] > 0:
        return coefficients, reference, covariance
    log_ratio = float(covariance[0, 6] / coefficients[0] / covariance[6, 6])
    moved, slope = coefficients.copy(), np.eye(9)
    for k in range(3):
        factor = np.exp(-exponents[k] * log_ratio)
        moved[k] *= factor
        slope[k, k], slope[k, 6 + k] = factor, -log_ratio * moved[k]
    seen = np.isfinite(np.diag(covariance))
    slope = np.where(np.outer(seen, seen), slope, 0.0)
    turned = slope @ np.where(np.outer(seen, seen), covariance, 0.0) @ slope.T
    return moved, reference * float(np.exp(log_ratio)), np.where(np.outer(seen, seen), turned, np.nan)


def _nonlinear_columns(problem: ForceProblem, at: At, solution: Real) -> list[Real]:
    """Return the derivatives of the weighted forces by exponents, runout and angles, by differences."""
    still = problem.design_at(at)

    def derivative(moved: At, step: float) -> Real:
        return np.asarray((problem.design_at(moved) - still) @ solution / step)

    steps, unit = np.eye(3), RUNOUT_STEP * problem.largest_feed
    columns = [
        derivative(at._replace(exponents=at.exponents + EXPONENT_STEP * steps[k]), EXPONENT_STEP) for k in problem.bent
    ]
    columns += [derivative(at._replace(runout=at.runout + unit * steps[k, :2]), unit) for k in range(problem.n_offsets)]
    if at.tilt is not None:
        tilts = (at.tilt + unit * steps[k, :2] for k in range(problem.n_offsets))
        columns += [derivative(at._replace(tilt=tilt), unit) for tilt in tilts]
    for number in range(len(at.angles)):
        moved = at.angles + ANGLE_STEP * (np.arange(len(at.angles)) == number)
        columns.append(derivative(at._replace(angles=moved), ANGLE_STEP))
    return columns


def _beyond_drift(difference: Complex, drift: Real) -> Complex:
    """Return differences of orders, (n_orders, n_axes), those of the means less what the drift of zero may make."""
    means = np.sqrt(np.maximum(difference[0].real ** 2 - drift**2, 0.0))
    return np.concatenate([means[None, :].astype(complex), difference[1:]])


def _power(values: Complex, orders: Index) -> float:
    return float(np.sum(np.where(orders > 0, 2.0, 1.0)[:, None] * np.abs(values) ** 2))
