"""Levenberg-Marquardt over poles and left vectors, checked on held-out lines."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Complex, Real

from ..models.out_of_band import basis_with_poles, fixed_poles
from .elimination import Elimination, Modes, derivatives, eliminate, predicted
from .measured_lines import MeasuredLines

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


_EVERY = 4  # each fourth line is held out
_HELD_OUT_LINES_STEPS, _HELD_OUT_LINES_TOLERANCE = 10, 1e-4


def holds_on_held_out_lines(start: Modes, refined: Modes, lines: MeasuredLines) -> bool:
    """Decide whether refined modes predict held-out lines better than the start does.

    Every fourth line is left out. Both sets of modes get their linear part, and the refined ones a further refinement,
    from the lines that stay.

    Parameters
    ----------
    start, refined
        Modes before and after the refinement.
    lines
        All lines of the fit, of which some are held out.
    """
    left_out = np.arange(len(lines.s)) % _EVERY == _EVERY // 2
    seen, unseen = lines.part(~left_out), lines.part(left_out)
    if len(unseen.s) < 2 or not len(start.poles):
        return True
    again = refine(refined, seen, steps=_HELD_OUT_LINES_STEPS, tolerance=_HELD_OUT_LINES_TOLERANCE)
    before, after = eliminate(start, seen), again.elimination
    return prediction_error(again.modes, after, unseen) <= prediction_error(start, before, unseen)


def prediction_error(modes: Modes, found: Elimination, lines: MeasuredLines) -> float:
    """Squared error on lines that the linear part was not fitted to."""
    return float(np.sum(np.abs(lines.values - predicted(modes, found, lines)) ** 2))


_FEWER: tuple[tuple[tuple[float, ...], tuple[float, ...]], ...] = (
    ((), (2.0,)),
    ((), (1.3, 3.0)),
    ((0.7,), (2.0,)),
)  # of the lower and the upper edge, the fewest first
_ALL = 3
_AS_GOOD = 1.1  # misfit over that with all poles: leakage lets more terms gain up to 8 % in stacked milling records
_OUTSIDE_TERMS_STEPS, _OUTSIDE_TERMS_TOLERANCE = 8, 1e-4


def with_fewest_terms(modes: Modes, lines: MeasuredLines) -> MeasuredLines:
    """The lines with the fewest fixed poles outside the band whose misfit is within a tenth of that with all.

    A pole outside the band takes up what a mode there adds, and leaks into the damping inside where there is none: FRFs
    of milling records carry leakage, which any further term explains in part.

    Parameters
    ----------
    modes
        Modes of the band.
    lines
        All lines, with all fixed poles.
    """
    if len(lines.outside_poles) < _ALL:
        return lines
    least = refine(modes, lines, steps=_OUTSIDE_TERMS_STEPS, tolerance=_OUTSIDE_TERMS_TOLERANCE).elimination.cost
    for below, above in _FEWER:
        tried = with_fixed_poles(lines, below, above)
        if (
            refine(modes, tried, steps=_OUTSIDE_TERMS_STEPS, tolerance=_OUTSIDE_TERMS_TOLERANCE).elimination.cost
            <= _AS_GOOD * least
        ):
            return tried
    return lines


def with_fixed_poles(lines: MeasuredLines, below: Sequence[float], above: Sequence[float]) -> MeasuredLines:
    """The lines with fixed poles at these multiples of the lower and upper edge of the band."""
    poles = fixed_poles(lines.band, below, above)
    return replace(lines, outside_poles=tuple(poles), basis=basis_with_poles(lines.s, lines.band, poles))
