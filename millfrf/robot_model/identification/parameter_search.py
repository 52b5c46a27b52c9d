"""Parameter estimation: global search, local refinement and standard errors, applied to planar robots."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from estimation import Frf
from millfrf.core import Complex, InputError, Real

from ..planar import TIP_IN_PLANE, PlanarRobot, rigid_matrices, tip_jacobian
from ..settings import IDENTIFICATION


@dataclass(frozen=True)
class Identification:
    """Positive parameters that were fitted to data, and their standard errors.

    Parameters
    ----------
    names
        Names of the parameters.
    values : (n_parameters,)
        Fitted values, in the parameters' units.
    relative_errors : (n_parameters,)
        Standard error of the logarithm; without a prior, within the identifiable directions only.
    identifiable : (n_parameters,), bool
        False where the parameter is part of an unidentifiable combination.
    unidentifiable
        Combinations ``a ln x + b ln y`` that the data does not determine, one line each.
    at_bound
        Names of parameters that ended at a bound; their errors are not reliable.
    residual : float
        Root mean square of the residuals, which are in units of their expected error.
    covariance : (n_parameters, n_parameters)
        Covariance of the logarithms; without a prior, within the identifiable directions only.
    """

    names: tuple[str, ...]
    values: Real
    relative_errors: Real
    identifiable: NDArray[np.bool_]
    unidentifiable: tuple[str, ...]
    at_bound: tuple[str, ...]
    residual: float
    covariance: Real

    @property
    def standard_errors(self) -> Real:
        """Standard errors of the values, in their units, shape (n_parameters,); infinite where unidentifiable."""
        return np.where(self.identifiable, self.values * self.relative_errors, np.inf)


def identify(
    residuals: Callable[[Real], Real],
    names: Sequence[str],
    lower: Real,
    upper: Real,
    *,
    start: Real | None = None,
    jacobian: Callable[[Real], Real] | None = None,
    prior: float = np.inf,
) -> Identification:
    """Fit the logarithms of positive parameters within bounds by least squares.

    Without a start the bounds are searched by differential evolution (Storn & Price 1997); Chen et al. 2026, section
    3.1, use a particle swarm. Neither needs a gradient. A trust-region fit follows in either case. The covariance is
    ``(J^T J / s^2 + I / prior^2)^-1`` with s the size of the residuals. Singular vectors of J along which the data
    alone leaves a standard error above a factor e are reported as unidentifiable.

    Parameters
    ----------
    residuals
        Function that takes parameter values (n_parameters,) and gives deviations divided by their expected error.
    names, lower, upper : (n_parameters,)
        Names of the parameters and their bounds, which are positive.
    start : (n_parameters,) or None
        Values to start from; None: global search.
    jacobian
        Derivative of the residuals over the logarithms, (n_data, n_parameters); None: by differences.
    prior
        Prior standard deviation of ln(parameter) about the start; infinite: none. It limits parameters that the data
        does not determine.

    Raises
    ------
    InputError
        Bounds that are not positive and increasing.
    """
    if not (np.all(lower > 0) and np.all(upper > lower)):
        raise InputError("identification: bounds must be positive, with the lower below the upper")
    low, high = np.log(lower), np.log(upper)
    begin = _global_search(residuals, low, high) if start is None else np.log(np.asarray(start, float))
    margin = 1e-9 * (high - low)  # least_squares needs a start strictly inside the bounds
    begin = np.clip(begin, low + margin, high - margin)
    # the prior enters as further residuals (x - start) / prior
    anchor = np.eye(len(begin)) / prior if np.isfinite(prior) else np.zeros((0, len(begin)))

    def with_prior(x: Real) -> Real:
        return np.concatenate([residuals(np.exp(x)), anchor @ (x - begin)])

    slope: Any = "2-point" if jacobian is None else lambda x: np.vstack([jacobian(np.exp(x)), anchor])
    best = scipy.optimize.least_squares(
        with_prior,
        begin,
        slope,
        bounds=(low, high),
        xtol=1e-9,
        ftol=1e-9,
        gtol=1e-9,
        max_nfev=400 if jacobian is None else 80,
    )
    close = np.minimum(best.x - low, high - best.x) < 1e-4 * (high - low)
    at_bound = tuple(name for name, active in zip(names, close, strict=True) if active)
    n_data = len(best.fun) - len(anchor)
    return _with_errors(tuple(names), np.exp(best.x), best.jac[:n_data], best.fun[:n_data], at_bound, prior)


def _global_search(residuals: Callable[[Real], Real], low: Real, high: Real) -> Real:
    """Search globally; return the logarithms of the best parameters."""
    search = scipy.optimize.differential_evolution(
        lambda x: float(np.sum(residuals(np.exp(x)) ** 2)),
        np.column_stack([low, high]),
        seed=0,
        maxiter=120,
        tol=1e-3,
        polish=False,
    )
    return np.asarray(search.x)


def _with_errors(
    names: tuple[str, ...],
    values: Real,
    jacobian: Real,
    residual: Real,
    at_bound: tuple[str, ...],
    prior: float,
) -> Identification:
    """Compute errors and unidentifiable combinations from the Jacobian over the logarithms (n_data, n_parameters)."""
    n_data, n_parameters = jacobian.shape
    freedom = n_data - n_parameters
    scale = float(np.sqrt(residual @ residual / freedom)) if freedom > 0 else 1.0
    _, strengths, directions = np.linalg.svd(jacobian)
    errors = np.full(n_parameters, np.inf)
    # singular values at rounding level have no finite error
    positive = strengths > 1e-12 * strengths.max(initial=1e-300)
    errors[: len(strengths)][positive] = scale / strengths[positive]
    known = errors <= IDENTIFICATION.identifiable_error
    information = 1 / errors**2 + 1 / prior**2
    with_prior = np.divide(1, np.sqrt(information), out=np.full(n_parameters, np.inf), where=information > 0)
    used = known | np.isfinite(with_prior)
    covariance = (directions[used].T * with_prior[used] ** 2) @ directions[used]
    share = np.sum(directions[~known] ** 2, axis=0)
    combinations = tuple(_combination(names, direction) for direction in _row_echelon(directions[~known]))
    root_mean_square = float(np.sqrt(np.mean(residual**2))) if n_data else 0.0
    deviations = np.sqrt(np.diag(covariance))
    return Identification(names, values, deviations, share < 1e-2, combinations, at_bound, root_mean_square, covariance)


def _row_echelon(directions: Real) -> Real:
    """Combine vectors of a null space so that they have few non-zero entries; pivots are the largest entries."""
    rows = directions.copy()
    for index in range(len(rows)):
        pivot = int(np.argmax(np.abs(rows[index])))
        rows[index] /= rows[index, pivot]
        for other in range(len(rows)):
            if other != index:
                rows[other] -= rows[other, pivot] * rows[index]
    return rows


def _combination(names: Sequence[str], direction: Real) -> str:
    order = [index for index in np.argsort(-np.abs(direction)) if abs(direction[index]) > 0.05]
    terms = [f"{direction[index]:+.2f} ln {names[index]}" for index in order]
    return " ".join(terms).replace("+1.00 ", "").replace("-1.00 ", "-")


# lowest and highest value, SI units: Chen et al. 2026, Eq. 21; the paper prints none for the damping ratios
BOUNDS = {"masses": (15.0, 125.0), "stiffness": (1e3, 1e7), "lengths": (0.2, 1.1), "damping_ratios": (1e-3, 0.3)}
LETTERS = {"masses": "m", "stiffness": "k", "lengths": "a", "damping_ratios": "zeta"}


def identify_from_frfs(
    robot: PlanarRobot,
    measured: Sequence[tuple[Real, Frf]],
    free: Sequence[str] = ("masses", "stiffness", "lengths"),
    *,
    search: bool = True,
) -> Identification:
    """Fit the rigid-link model to receptances, with the relative deviation on every valid line as the residual.

    ``measured`` are pairs of joint angles (rad) and a receptance over any of the tip's degrees of freedom in the plane.
    ``free`` may contain ``masses``, ``stiffness``, ``lengths`` and ``damping_ratios`` (Chen et al. 2026, Eq. 21).
    """
    cases = [(angles, frf, *_indices(frf)) for angles, frf in measured]

    def residuals(trial: PlanarRobot) -> Real:
        parts = []
        for angles, frf, rows, columns in cases:
            model = _receptance(trial, angles, frf.frequencies[frf.valid])
            values = frf.values[frf.valid]
            ratio = (model[:, rows][:, :, columns] - values) / np.abs(values)
            parts += [ratio.real.ravel(), ratio.imag.ravel()]
        return np.concatenate(parts)

    return _identify(robot, residuals, free, search)


def identify_from_frequencies(
    robot: PlanarRobot,
    measured: Sequence[tuple[Real, float]],
    free: Sequence[str] = ("masses", "stiffness", "lengths"),
    *,
    relative_error: float = 0.01,
    search: bool = True,
) -> Identification:
    """Fit the rigid-link model to the first natural frequency at several poses.

    Parameters
    ----------
    robot
        Robot that gives the values of what is not free, and the start where ``search`` is False.
    measured
        Joint angles (rad) of each pose and the first natural frequency measured in it, Hz.
    free
        Parameters to fit, among ``masses``, ``stiffness``, ``lengths``, ``damping_ratios``.
    relative_error
        Standard error of a frequency over its value.
    search
        Whether the bounds are searched globally first.

    Raises
    ------
    InputError
        An unknown name in ``free``.
    """

    def residuals(trial: PlanarRobot) -> Real:
        first = [_first_frequency(trial, angles) for angles, _ in measured]
        return np.array([f / value - 1 for f, (_, value) in zip(first, measured, strict=True)]) / relative_error

    return _identify(robot, residuals, free, search)


def _first_frequency(robot: PlanarRobot, angles: Real) -> float:
    mass, stiffness = rigid_matrices(robot, angles)
    return float(np.sqrt(scipy.linalg.eigvalsh(stiffness, mass)[0]) / (2 * np.pi))


def _receptance(robot: PlanarRobot, angles: Real, frequencies: Real) -> Complex:
    """Compute ``rigid_model(...).receptance(...)`` without its checks, because the search calls it often."""
    mass, stiffness = rigid_matrices(robot, angles)
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    tip = tip_jacobian(robot, angles) @ shapes
    omega = 2 * np.pi * frequencies[:, None]
    modes = 1 / (squares - omega**2 + 2j * robot.damping_ratios * np.sqrt(squares) * omega)
    return np.asarray((modes[:, None, :] * tip) @ tip.T)


def apply_identified(robot: PlanarRobot, identification: Identification) -> PlanarRobot:
    """Return the robot with the identified values; flexible sections keep their stiffness.

    Parameters
    ----------
    robot
        Robot that was identified.
    identification
        Identification of its parameters.
    """
    named = dict(zip(identification.names, identification.values, strict=True))
    changes: dict[str, Any] = {
        field: np.array([named.get(f"{letter}{i}", old) for i, old in enumerate(getattr(robot, field), 1)], dtype=float)
        for field, letter in LETTERS.items()
    }
    return replace(robot, **changes)


def _identify(
    robot: PlanarRobot, residuals: Callable[[PlanarRobot], Real], free: Sequence[str], search: bool
) -> Identification:
    unknown = [name for name in free if name not in LETTERS]
    if unknown or not free:
        raise InputError(f"cannot identify {', '.join(unknown) or 'nothing'}; use {', '.join(LETTERS)}")
    n_links = len(robot.lengths)
    names = [f"{LETTERS[name]}{index + 1}" for name in free for index in range(n_links)]
    lower, upper = (np.repeat([BOUNDS[name][side] for name in free], n_links) for side in (0, 1))
    start = np.concatenate([getattr(robot, name) for name in free])

    def of_values(values: Real) -> Real:
        columns = dict(zip(free, np.split(values, len(free)), strict=True))
        return residuals(replace(robot, sections=None, **columns))

    return identify(of_values, names, lower, upper, start=None if search else start)


def _indices(frf: Frf) -> tuple[list[int], list[int]]:
    unknown = [name for name in (*frf.responses, *frf.excitations) if name not in TIP_IN_PLANE]
    if unknown or frf.quantity != "receptance":
        raise InputError(
            f"identification in the plane takes a receptance at {', '.join(TIP_IN_PLANE)}; "
            f"this is a {frf.quantity}" + (f" at {', '.join(unknown)}" if unknown else "")
        )
    return [TIP_IN_PLANE.index(name) for name in frf.responses], [TIP_IN_PLANE.index(n) for n in frf.excitations]
