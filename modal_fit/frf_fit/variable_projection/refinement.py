"""Levenberg-Marquardt over poles and left vectors, with everything linear eliminated at each step."""

from dataclasses import dataclass

import numpy as np

from .elimination import Complex, Elimination, Modes, Real, derivatives, eliminate
from .whitened_lines import MeasuredLines

_FIRST_DAMPING = 1e-3
_LARGEST_DAMPING = 1e8


@dataclass(frozen=True)
class Refined:
    """Modes at the least misfit.

    Parameters
    ----------
    modes
        Poles and left vectors.
    elimination
        The linear part that belongs to them.
    converged
        Whether the last step gained less than the tolerance.
    """

    modes: Modes
    elimination: Elimination
    converged: bool


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations ``matrix step = gradient`` of the real unknowns: all real parts, then all imaginary parts.

    Parameters
    ----------
    matrix : (2 n_unknowns, 2 n_unknowns)
        Normal matrix of real parts of poles and free left entries, then imaginary parts.
    gradient : (2 n_unknowns, n_responses)
        Downhill gradient, one column a response; the sum of the columns is the gradient of half the cost.
    right : (n_unknowns, n_responses)
        Entries of the right vectors by which each unknown is multiplied.
    pieces : (2 n_unknowns, 2 n_unknowns)
        Products of the projected functions u and v.
    """

    matrix: Real
    gradient: Real
    right: Complex
    pieces: Real


def refine(modes: Modes, lines: MeasuredLines, *, steps: int, tolerance: float) -> Refined:
    """Lower the misfit over poles and left vectors (Golub & Pereyra 1973, with Kaufman's Jacobian of 1975).

    Memory and time grow linearly with the responses: they enter through sums of products of their right vectors only.

    Parameters
    ----------
    modes
        Modes to start from; their poles must be stable and lie in the upper half plane.
    lines
        Lines that are fitted.
    steps
        Largest number of steps.
    tolerance
        Relative gain of the cost below which the search ends.
    """
    modes = modes.scaled()
    found = eliminate(modes, lines)
    damping = _FIRST_DAMPING
    if not len(modes.poles):
        return Refined(modes, found, True)
    for _ in range(steps):
        better, damping = _step(modes, lines, found, damping)
        if better is None:
            return Refined(modes, found, True)
        gain = (found.cost - better[1].cost) / max(better[1].cost, 1e-300)
        modes, found = better
        if gain < tolerance:
            return Refined(modes, found, True)
    return Refined(modes, found, False)


def _step(
    modes: Modes, lines: MeasuredLines, found: Elimination, damping: float
) -> tuple[tuple[Modes, Elimination] | None, float]:
    """The next modes, or None where no step lowers the cost; and the damping for the step after."""
    normal = normal_equations(modes, lines, found)
    scale = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    matrix, downhill = normal.matrix / np.outer(scale, scale), normal.gradient.sum(axis=1) / scale
    n_unknowns = len(scale) // 2
    while damping < _LARGEST_DAMPING:
        step = np.linalg.solve(matrix + damping * np.eye(len(matrix)), downhill) / scale
        trial = modes.moved(step[:n_unknowns] + 1j * step[n_unknowns:])
        if trial.poles.real.max() < 0 < trial.poles.imag.min():
            after = eliminate(trial, lines)
            if after.cost < found.cost:
                rescaled = trial.scaled()
                changed = not np.array_equal(rescaled.left, trial.left)
                return (rescaled, eliminate(rescaled, lines) if changed else after), max(damping / 10, 1e-9)
        damping *= 10
    return None, damping


def normal_equations(modes: Modes, lines: MeasuredLines, found: Elimination) -> NormalEquations:
    """Gauss-Newton equations of the projected problem, summed over the responses."""
    functions, owners = derivatives(modes, lines)
    functions -= found.orthogonal @ (found.orthogonal.T @ functions)
    pieces, against = functions.T @ functions, functions.T @ found.error
    n = len(owners)
    right = found.right[owners]
    real, imaginary = right.real, right.imag
    gradient = np.concatenate(
        [real * against[:n] + imaginary * against[n:], real * against[n:] - imaginary * against[:n]]
    )
    return NormalEquations(_summed(right, pieces), gradient, right, pieces)


def _summed(right: Complex, pieces: Real) -> Real:
    """The matrix for the responses whose right vectors' entries are ``right`` (n_unknowns, n_responses)."""
    real, imaginary = right.real, right.imag
    n = len(right)
    rr, ri, ii = real @ real.T, real @ imaginary.T, imaginary @ imaginary.T
    uu, uv, vv = pieces[:n, :n], pieces[:n, n:], pieces[n:, n:]
    first = rr * uu + ri * uv + ri.T * uv.T + ii * vv
    second = rr * vv - ri * uv.T - ri.T * uv + ii * uu
    mixed = rr * uv - ri * uu + ri.T * vv - ii * uv.T
    return np.block([[first, mixed], [mixed.T, second]])


def without_response(normal: NormalEquations, left_out: int) -> tuple[Real, Real]:
    """Matrix and summed gradient with one response left out."""
    alone = _summed(normal.right[:, left_out : left_out + 1], normal.pieces)
    return normal.matrix - alone, np.asarray(normal.gradient.sum(axis=1) - normal.gradient[:, left_out])


def weighted_matrix(modes: Modes, lines: MeasuredLines, found: Elimination, weights: Real) -> Real:
    """The matrix of the normal equations with weights (n_rows,) on the squared Jacobian."""
    functions, owners = derivatives(modes, lines)
    functions -= found.orthogonal @ (found.orthogonal.T @ functions)
    return _summed(found.right[owners], functions.T @ (functions * weights[:, None]))
