"""Least squares within bounds by damped Gauss-Newton steps that are brought back inside."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Real = NDArray[np.float64]

DAMPING = 1e-6
"""Of the first step, as a share of the information's diagonal."""

REFUSALS = 6
"""Steps in a row that may fail, each damped thirty times more, before a fit is taken to have ended."""


@dataclass(frozen=True)
class Least:
    """Where the sum of squares ends.

    Parameters
    ----------
    x : (n,)
    cost
        Sum of squares there.
    information : (n, n)
        ``J^T J`` at the last point at which slopes were taken.
    """

    x: Real
    cost: float
    information: Real


def least_squares_within(
    residual: Callable[[Real], Real],
    slopes: Callable[[Real, Real], Real],
    start: Real,
    bounds: tuple[Real, Real],
    *,
    most: int = 15,
    gain: float = 0.1,
) -> Least:
    """Minimise ``sum residual(x)^2`` within bounds.

    Levenberg's steps; numbers at a bound that the gradient pushes outwards are held (Bertsekas, SIAM J. Control Optim.
    20, 1982).

    Parameters
    ----------
    residual
        From x (n,) to (m,).
    slopes
        From x and the residual there to the Jacobian (m, n).
    start : (n,)
        Within the bounds.
    bounds
        Lowest and highest, (n,) each.
    most
        Steps.
    gain
        Fall of the sum of squares below which steps end.

    Examples
    --------
    >>> line = np.arange(4.0)
    >>> fit = least_squares_within(
    ...     lambda x: x[0] * line - 2 * line, lambda x, r: line[:, None], np.zeros(1), (np.zeros(1), np.ones(1))
    ... )
    >>> fit.x.tolist()
    [1.0]
    """
    low, high = bounds
    x, rest = start, residual(start)
    cost, damping = float(rest @ rest), DAMPING
    information = np.zeros((len(x), len(x)))
    for _ in range(most):
        jacobian = slopes(x, rest)
        information, gradient = jacobian.T @ jacobian, jacobian.T @ rest
        before = cost
        for _ in range(REFUSALS):
            tried = _step(x, information, gradient, damping, low, high)
            new = residual(tried)
            if new @ new < cost:
                x, rest, cost, damping = tried, new, float(new @ new), max(damping / 30, 1e-9)
                break
            damping *= 30
        if before - cost < gain:
            break
    return Least(x, cost, information)


def _step(x: Real, information: Real, gradient: Real, damping: float, low: Real, high: Real) -> Real:
    """The next point: numbers that would leave the bounds are set on them, and the others solved again."""
    free = ~(((x <= low) & (gradient > 0)) | ((x >= high) & (gradient < 0)))
    tried = x.copy()
    for _ in range(len(x)):
        if not free.any():
            break
        part = information[np.ix_(free, free)]
        push = -gradient[free] - information[np.ix_(free, ~free)] @ (tried - x)[~free]
        part = part + np.diag(damping * np.diag(part) + 1e-12 * np.trace(part) + 1e-300)
        tried[free] = x[free] + np.linalg.solve(part, push)
        outside = (tried < low) | (tried > high)
        tried = np.clip(tried, low, high)
        if not outside.any():
            break
        free &= ~outside
    return np.asarray(tried)
