"""Parameter estimation: global search, local refinement, standard errors, unidentifiable directions."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import InputError, Real

UNKNOWN_BEYOND = 1.0
"""A direction in the logarithms of the parameters is unidentifiable if its standard error is larger: a factor e."""


@dataclass(frozen=True)
class Identification:
    """Positive parameters that were fitted to data, with their errors.

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
        Combinations ``a ln x + b ln y`` that the data does not fix, one line each.
    at_bound
        Names of parameters that ended at a bound: their errors mean little.
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
    seed: int = 0,
    generations: int = 120,
) -> Identification:
    """Fit the logarithms of positive parameters within bounds by least squares.

    Without a start the bounds are searched by differential evolution (Storn & Price 1997), where Chen et al. 2026,
    section 3.1, use a particle swarm; both need no gradient. Either way a trust-region polish follows. Standard errors
    are ``(J^T J / s^2 + I / prior^2)^-1`` with s the size of the residuals; singular vectors of J along which the data
    alone leaves a factor e open are named.

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
        Standard deviation of ln(parameter) about the start, before the data speaks: it keeps parameters that the data
        does not fix from running off; infinite: none.
    seed, generations
        Seed and number of generations of the global search.

    Raises
    ------
    InputError
        Bounds that are not positive and increasing.
    """
    if not (np.all(lower > 0) and np.all(upper > lower)):
        raise InputError("identification: bounds must be positive, with the lower below the upper")
    low, high = np.log(lower), np.log(upper)
    begin = _searched(residuals, low, high, seed, generations) if start is None else np.log(np.asarray(start, float))
    margin = 1e-9 * (high - low)
    begin = np.clip(begin, low + margin, high - margin)
    held = np.isfinite(prior)
    anchor = np.eye(len(begin)) / prior if held else np.zeros((0, len(begin)))

    def whole(x: Real) -> Real:
        return np.concatenate([residuals(np.exp(x)), anchor @ (x - begin)])

    slope: Any = "2-point" if jacobian is None else lambda x: np.vstack([jacobian(np.exp(x)), anchor])
    best = scipy.optimize.least_squares(
        whole,
        begin,
        slope,
        bounds=(low, high),
        xtol=1e-9,
        ftol=1e-9,
        gtol=1e-9,
        max_nfev=400 if jacobian is None else 80,
    )
    at_bound = tuple(name for name, active in zip(names, _near(best.x, low, high), strict=True) if active)
    n_data = len(best.fun) - len(anchor)
    return judged(tuple(names), np.exp(best.x), best.jac[:n_data], best.fun[:n_data], at_bound, prior)


def _searched(residuals: Callable[[Real], Real], low: Real, high: Real, seed: int, generations: int) -> Real:
    """Logarithms of the best parameters of a global search."""
    search = scipy.optimize.differential_evolution(
        lambda x: float(np.sum(residuals(np.exp(x)) ** 2)),
        np.column_stack([low, high]),
        seed=seed,
        maxiter=generations,
        tol=1e-3,
        polish=False,
    )
    return np.asarray(search.x)


def judged(
    names: tuple[str, ...],
    values: Real,
    jacobian: Real,
    residual: Real,
    at_bound: tuple[str, ...] = (),
    prior: float = np.inf,
) -> Identification:
    """Standard errors and unidentifiable combinations from the Jacobian over the logarithms (n_data, n_parameters)."""
    n_data, n_parameters = jacobian.shape
    freedom = n_data - n_parameters
    scale = float(np.sqrt(residual @ residual / freedom)) if freedom > 0 else 1.0
    _, strengths, directions = np.linalg.svd(jacobian)
    errors = np.full(n_parameters, np.inf)
    positive = strengths > 1e-12 * strengths.max(initial=1e-300)
    errors[: len(strengths)][positive] = scale / strengths[positive]
    known = errors <= UNKNOWN_BEYOND
    information = 1 / errors**2 + 1 / prior**2
    both = np.divide(1, np.sqrt(information), out=np.full(n_parameters, np.inf), where=information > 0)
    told = known | np.isfinite(both)
    covariance = (directions[told].T * both[told] ** 2) @ directions[told]
    share = np.sum(directions[~known] ** 2, axis=0)
    combinations = tuple(_combination(names, direction) for direction in _simplified(directions[~known]))
    root_mean_square = float(np.sqrt(np.mean(residual**2))) if n_data else 0.0
    identifiable = share < 1e-2
    deviations = np.sqrt(np.diag(covariance))
    return Identification(names, values, deviations, identifiable, combinations, at_bound, root_mean_square, covariance)


def _simplified(directions: Real) -> Real:
    """The same null space spanned by vectors with few entries: row echelon form with pivots on the largest entries."""
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


def _near(x: Real, low: Real, high: Real) -> NDArray[np.bool_]:
    return np.asarray(np.minimum(x - low, high - x) < 1e-4 * (high - low))
