"""Misfit of a robot to its measurements, its most probable parameters, and their covariance."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Real

from ..settings import UPDATE
from ..spatial.spatial_robot import SpatialRobot
from .changed_structure import UpdateParameter
from .matrices import PostureSystem, posture_system
from .posed_receptance import PosedReceptance
from .posture_response import PostureResponse


@dataclass(frozen=True)
class Problem:
    """Free parameters, and the measurements, each with the robot's matrices in its posture."""

    parameters: tuple[UpdateParameter, ...]
    postures: tuple[tuple[PosedReceptance, PostureSystem], ...]

    @property
    def precision(self) -> Real:
        """Return the precision of the prior, ``1 / spread^2``, (n_parameters,)."""
        return np.array([1 / parameter.spread**2 for parameter in self.parameters])

    def without(self, index: int) -> "Problem":
        """Return the problem without one measurement."""
        return Problem(self.parameters, self.postures[:index] + self.postures[index + 1 :])

    def only(self, index: int) -> "Problem":
        """Return the problem with a single measurement."""
        return Problem(self.parameters, self.postures[index : index + 1])


def problem_of(
    robot: SpatialRobot, parameters: Sequence[UpdateParameter], measured: Sequence[PosedReceptance]
) -> Problem:
    """Assemble the robot's matrices in the posture of each measurement."""
    postures = [(case, posture_system(robot, parameters, case.q, case.axes, case.sensor)) for case in measured]
    return Problem(tuple(parameters), tuple(postures))


@dataclass(frozen=True)
class Sums:
    """Scalar products over the whitened lines of one posture.

    They are of the errors r, the derivatives J of r over x, and the derivatives G of r over errors of the modes.
    """

    rr: float
    rj: Real
    rg: Real
    jj: Real
    jg: Real
    gg: Real
    count: float  # independent real numbers behind the sums
    unexplained: float  # variance of the part of the errors that neither J nor G can explain: 1 is the stated noise
    correlation: float  # autocorrelation of that part along the lines, summed: 0 where neighbouring lines differ


def sums_at(problem: Problem, x: Real) -> list[Sums]:
    """Compute the sums of every posture at the differences x; raise LinAlgError if the mass is not positive there."""
    return [_sums(problem.parameters, measured, system, x) for measured, system in problem.postures]


def _sums(parameters: Sequence[UpdateParameter], measured: PosedReceptance, system: PostureSystem, x: Real) -> Sums:
    response, errors = _response_and_errors(parameters, measured, system, x)
    slopes = measured.whitened(measured.as_measured(response.slopes())).T
    derivatives, sizes = response.mode_derivatives()
    modes = measured.whitened(measured.as_measured(derivatives)).T * sizes
    # the unexplained part is the projection of the errors off the span of J and G
    spanned = np.hstack([slopes, modes])
    size = np.sqrt(np.sum(spanned**2, axis=0))
    unit = spanned / np.where(size > 0, size, 1.0)
    values, vectors = np.linalg.eigh(unit.T @ unit)
    directions = vectors[:, values > 1e-10 * values[-1]] / np.sqrt(values[values > 1e-10 * values[-1]])
    unexplained = errors - unit @ (directions @ (directions.T @ (unit.T @ errors)))
    freedom = max(measured.count * (1 - directions.shape[1] / max(len(errors), 1)), 1.0)
    return Sums(
        float(errors @ errors),
        slopes.T @ errors,
        modes.T @ errors,
        slopes.T @ slopes,
        slopes.T @ modes,
        modes.T @ modes,
        measured.count,
        float(unexplained @ unexplained) / freedom if measured.projection is None else 1.0,
        _correlation(unexplained, measured),
    )


def _response_and_errors(
    parameters: Sequence[UpdateParameter], measured: PosedReceptance, system: PostureSystem, x: Real
) -> tuple[PostureResponse, Real]:
    response = PostureResponse(system, parameters, x, measured.lines, measured.rows, measured.columns)
    return response, measured.whitened(measured.as_measured(response.receptance()) - measured.values)


def _correlation(unexplained: Real, measured: PosedReceptance) -> float:
    """Sum the positive autocorrelations of the unexplained errors at distances of one to five lines."""
    if measured.projection is not None:
        return 0.0
    half = len(unexplained) // 2
    lines = (unexplained[:half] + 1j * unexplained[half:]).reshape(len(measured.frequencies), -1)
    power = float(np.sum(np.abs(lines) ** 2))
    if not power:
        return 0.0
    lags = range(1, min(6, len(lines) // 4))
    return float(sum(max(float(np.real(np.vdot(lines[k:], lines[:-k]))), 0.0) / power for k in lags))


def marginal_misfit(sums: Sequence[Sums], scale: float, modes_off: float) -> tuple[float, Real, Real]:
    """Compute the misfit ``r^T (s^2 I + t^2 G G^T)^-1 r``, half of its gradient, and its Gauss-Newton matrix.

    The errors of the modes are marginalised by Woodbury's identity. ``scale`` is the variance s^2 of the whitened
    errors, and ``modes_off`` the standard deviation t of a mode's relative frequency from the modelled frequency.
    """
    misfit, gradient, matrix = 0.0, np.zeros_like(sums[0].rj), np.zeros_like(sums[0].jj)
    for case in sums:
        misfit += case.rr
        gradient = gradient + case.rj
        matrix = matrix + case.jj
        if modes_off > 0 and len(case.gg):
            root = np.linalg.cholesky(case.gg + np.eye(len(case.gg)) * scale / modes_off**2)
            r, j = np.linalg.solve(root, case.rg), np.linalg.solve(root, case.jg.T)
            misfit -= float(r @ r)
            gradient = gradient - j.T @ r
            matrix = matrix - j.T @ j
    return misfit / scale, gradient / scale, matrix / scale


def misfit_of(problem: Problem, index: int, x: Real) -> float:
    """Compute the root mean square error on one measurement in units of its noise: 1 if only noise is left."""
    measured, system = problem.postures[index]
    _, errors = _response_and_errors(problem.parameters, measured, system, x)
    return float(np.sqrt(errors @ errors / measured.count))


@dataclass(frozen=True)
class Posterior:
    """Posterior of the free parameters: most probable differences x (n_parameters,) and Laplace's covariance."""

    x: Real
    covariance: Real
    scale: float  # variance of the whitened errors: 1 where the stated noise is right
    modes_off: float  # standard deviation of the modes' relative frequencies from the modelled ones

    @property
    def errors(self) -> Real:
        """Standard errors, (n_parameters,)."""
        return np.sqrt(np.diag(self.covariance))


def most_probable(problem: Problem) -> Posterior:
    """Search the most probable parameters from the file's numbers; try further starts if more than noise is left."""
    best, least = _staged(problem, np.zeros(len(problem.parameters)))
    best, least = _best_of(problem, _further_starts(problem.parameters), best, least, first=True)
    best, least = _best_of(problem, _mirrored_payloads(problem.parameters, best), best, least)
    return refined(problem, best)


def _best_of(
    problem: Problem, starts: Iterable[Real], best: Real, least: float, *, first: bool = False
) -> tuple[Real, float]:
    """Search from further starts if ``least`` is more than noise; return the best parameters and their misfit.

    With ``first``, stop at the first start after which only noise is left.
    """
    if least > UPDATE.restart_ratio:
        for start in starts:
            x, misfit = _staged(problem, start)
            if misfit < least:
                best, least = x, misfit
            if first and least < UPDATE.restart_ratio:
                break
    return best, least


def _mirrored_payloads(parameters: Sequence[UpdateParameter], x: Real) -> list[Real]:
    """List starts that differ from x in the side of the tool's axis on which the payload is.

    A descent cannot change the side, because on the way the misfit hardly depends on the payload's place.
    """
    starts = []
    for axes in ((0, 1), (0,), (1,)):
        mirrored = np.array([parameter.kind == "payload" and parameter.axis in axes for parameter in parameters])
        starts.append(np.where(mirrored, -x, x))
    return starts


def _further_starts(parameters: Sequence[UpdateParameter]) -> list[Real]:
    """List starts with stiffer or softer joints, a lighter or heavier end, a compliant tool, or a compliant base."""
    changes = (
        ("payload", 3, -8.0),
        ("tool", 0, 1e-7),
        ("stiffness", 0, -0.3),
        ("stiffness", 0, 0.3),
        ("payload", 3, 8.0),
        ("base", 0, 1e-8),
    )
    return [
        np.array([size if (parameter.kind, parameter.axis) == (kind, axis) else 0.0 for parameter in parameters])
        for kind, axis, size in changes
    ]


def _staged(problem: Problem, x: Real) -> tuple[Real, float]:
    """Search in stages from x; return the parameters and the root mean square error in units of the noise.

    Each stage takes the remaining misfit as noise, so that the prior limits the parameters while the misfit is large.
    The allowed error of the modes decreases from stage to stage: the first likelihood is coarse and has no local
    minima.
    """
    for modes_off in UPDATE.stages:
        scale = max(1.0, _mean_square(problem, x))
        x, _ = descend(problem, x, scale, modes_off, steps=10)
    return x, float(np.sqrt(_mean_square(problem, x)))


def _mean_square(problem: Problem, x: Real) -> float:
    try:
        sums = sums_at(problem, x)
    except (scipy.linalg.LinAlgError, np.linalg.LinAlgError):
        return np.inf
    return sum(case.rr for case in sums) / sum(case.count for case in sums)


def refined(problem: Problem, x: Real, fixed: NDArray[np.bool_] | None = None, rounds: int = 3) -> Posterior:
    """Refine parameters that are near the optimum.

    The parameters, the size of the noise and the modes' deviation are estimated in turn. Parameters that are marked in
    ``fixed`` (n_parameters,) do not change.
    """
    scale, modes_off = 1.0, UPDATE.stages[-1]
    for _ in range(rounds):
        x, _ = descend(problem, x, scale, modes_off, fixed)
        sums = sums_at(problem, x)
        scale = _noise_scale(sums)
        modes_off = _modes_deviation(problem, sums, scale)
    x, _ = descend(problem, x, scale, modes_off, fixed)
    return Posterior(x, laplace_covariance(problem, sums_at(problem, x), scale, modes_off), scale, modes_off)


def laplace_covariance(problem: Problem, sums: Sequence[Sums], scale: float, modes_off: float) -> Real:
    """Compute the covariance: the inverse of Fisher's information plus the prior's precision.

    The matrix is scaled by the prior before inversion, because the parameters have different units.
    """
    root = np.sqrt(problem.precision)
    matrix = marginal_misfit(sums, scale, modes_off)[2] / np.outer(root, root) + np.eye(len(root))
    return np.asarray(np.linalg.inv(matrix) / np.outer(root, root))


def _noise_scale(sums: Sequence[Sums]) -> float:
    """Estimate the variance of the whitened errors, at least 1; correlated errors of neighbouring lines increase it."""
    unexplained = float(np.mean([case.unexplained for case in sums]))
    return max(unexplained, 1.0) * max(1 + 2 * case.correlation for case in sums)


def _modes_deviation(problem: Problem, sums: Sequence[Sums], scale: float) -> float:
    """Find the modes' deviation with the largest evidence (restricted likelihood, Patterson & Thompson 1971)."""
    candidates = np.geomspace(UPDATE.least_modes_off, 0.2, 25)
    return float(min(candidates, key=lambda off: _minus_log_evidence(problem, sums, scale, float(off))))


def _minus_log_evidence(problem: Problem, sums: Sequence[Sums], scale: float, modes_off: float) -> float:
    misfit, gradient, matrix = marginal_misfit(sums, scale, modes_off)
    curvature = matrix + np.diag(problem.precision)
    value = misfit - float(gradient @ np.linalg.solve(curvature, gradient)) + float(np.linalg.slogdet(curvature)[1])
    for case in sums:
        value += float(np.linalg.slogdet(np.eye(len(case.gg)) + modes_off**2 * case.gg / scale)[1])
    return value


def descend(
    problem: Problem,
    x: Real,
    scale: float,
    modes_off: float,
    fixed: NDArray[np.bool_] | None = None,
    steps: int = 25,
) -> tuple[Real, float]:
    """Minimise misfit plus prior by Levenberg and Marquardt's method (Nocedal & Wright, section 10.3).

    Returns the parameters and the minimum.
    """
    free = np.ones(len(x), dtype=bool) if fixed is None else ~np.asarray(fixed, dtype=bool)
    precision = problem.precision
    damping, current = 1e-3, _objective(problem, x, scale, modes_off)
    if current is None:
        return x, np.inf
    for _ in range(steps):
        value, gradient, matrix = current
        curvature = (matrix + np.diag(precision))[np.ix_(free, free)]
        slope = (gradient + precision * x)[free]
        step = np.zeros_like(x)
        step[free] = -np.linalg.solve(curvature + damping * np.diag(np.diag(curvature)), slope)
        # no parameter moves by more than 0.7 of its prior standard deviation at once
        step /= max(1.0, float(np.max(np.abs(step) * np.sqrt(precision))) / 0.7)
        trial = _objective(problem, x + step, scale, modes_off)
        if trial is None or trial[0] > value:
            damping *= 8
            if damping > 1e6:
                break
            continue
        x, current, damping = x + step, trial, max(damping / 5, 1e-9)
        if value - trial[0] < 1e-3 + 1e-7 * value:
            break
    return x, current[0]


def _objective(problem: Problem, x: Real, scale: float, modes_off: float) -> tuple[float, Real, Real] | None:
    """Compute misfit plus prior, and the misfit's gradient and matrix; return None if the mass is not positive at x."""
    try:
        misfit, gradient, matrix = marginal_misfit(sums_at(problem, x), scale, modes_off)
    except (scipy.linalg.LinAlgError, np.linalg.LinAlgError):
        return None
    return misfit + float(problem.precision @ x**2), gradient, matrix


def added_parts(parameters: Sequence[UpdateParameter]) -> NDArray[np.bool_]:
    """Mark parameters that add a spring or damper that the file does not have; these cannot be negative."""
    return np.array([parameter.kind in ("tool", "base", "joint damping") for parameter in parameters], dtype=bool)


def without_insignificant_parts(problem: Problem, posterior: Posterior) -> Posterior:
    """Set added springs and dampers to zero if they are below twice their error; refine all other parameters."""
    fixed = np.zeros(len(posterior.x), dtype=bool)
    for _ in range(3):
        low = added_parts(problem.parameters) & ~fixed & (posterior.x < 2 * posterior.errors)
        if not low.any():
            break
        fixed |= low
        posterior = refined(problem, np.where(fixed, 0.0, posterior.x), fixed, rounds=2)
    return posterior
