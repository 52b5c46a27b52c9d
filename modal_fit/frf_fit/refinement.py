"""Refinement of poles and left vectors by Levenberg-Marquardt steps, checked on held-out lines."""

from dataclasses import dataclass

import numpy as np

from millfrf.core import Complex, Real

from ..settings import SETTINGS, Effort
from .elimination import Elimination, Modes, derivatives, eliminate, predicted
from .measured_lines import MeasuredLines


@dataclass(frozen=True)
class Refined:
    """Modes at the least misfit that the refinement reached."""

    modes: Modes
    elimination: Elimination  # the linear unknowns that belong to the modes
    converged: bool  # whether the last step gained less than the tolerance


@dataclass(frozen=True)
class NormalEquations:
    """Normal equations ``matrix step = gradient`` of the real unknowns: all real parts, then all imaginary parts.

    The unknowns are the poles and the free entries of the left vectors.
    """

    matrix: Real  # (2 n_unknowns, 2 n_unknowns)
    gradient: Real  # (2 n_unknowns, n_responses): minus the gradient of half the cost, response by response
    right: Complex  # (n_unknowns, n_responses): right vector of the mode to which each unknown belongs
    products: Real  # (2 n_unknowns, 2 n_unknowns): scalar products of the projected functions u and v


def refine(modes: Modes, lines: MeasuredLines, effort: Effort) -> Refined:
    """Lower the misfit over poles and left vectors (Golub & Pereyra 1973, with Kaufman's Jacobian of 1975).

    Memory and time grow linearly with the number of responses.
    The poles of ``modes`` must be stable and lie in the upper half plane.
    """
    modes = modes.scaled()
    elimination = eliminate(modes, lines)
    damping = SETTINGS.first_step_damping
    if not len(modes.poles):
        return Refined(modes, elimination, True)
    for _ in range(effort.steps):
        better, damping = _step(modes, lines, elimination, damping)
        if better is None:
            return Refined(modes, elimination, True)
        gain = (elimination.cost - better[1].cost) / max(better[1].cost, 1e-300)
        modes, elimination = better
        if gain < effort.tolerance:
            return Refined(modes, elimination, True)
    return Refined(modes, elimination, False)


def _step(
    modes: Modes, lines: MeasuredLines, elimination: Elimination, damping: float
) -> tuple[tuple[Modes, Elimination] | None, float]:
    """Return the modes after a step, or None where no step lowers the cost, and the damping of the following step."""
    normal = normal_equations(modes, lines, elimination)
    scale = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    matrix, downhill = normal.matrix / np.outer(scale, scale), normal.gradient.sum(axis=1) / scale
    n_unknowns = len(scale) // 2
    while damping < SETTINGS.largest_step_damping:
        step = np.linalg.solve(matrix + damping * np.eye(len(matrix)), downhill) / scale
        trial = modes.moved(step[:n_unknowns] + 1j * step[n_unknowns:])
        if trial.poles.real.max() < 0 < trial.poles.imag.min():
            after = eliminate(trial, lines)
            if after.cost < elimination.cost:
                # another entry of a left vector may have become the largest
                scaled = trial.scaled()
                changed = not np.array_equal(scaled.left, trial.left)
                return (scaled, eliminate(scaled, lines) if changed else after), max(damping / 10, 1e-9)
        damping *= 10
    return None, damping


def _projected_functions(modes: Modes, lines: MeasuredLines, elimination: Elimination) -> tuple[Real, Complex]:
    """Return the functions of :func:`derivatives` minus the part in the span of the regressors.

    Also return the right vector that belongs to each unknown.
    """
    functions, owners = derivatives(modes, lines)
    functions -= elimination.orthogonal @ (elimination.orthogonal.T @ functions)
    return functions, elimination.right[owners]


def normal_equations(modes: Modes, lines: MeasuredLines, elimination: Elimination) -> NormalEquations:
    """Return the Gauss-Newton equations of the projected problem, summed over the responses."""
    functions, right = _projected_functions(modes, lines, elimination)
    products, against = functions.T @ functions, functions.T @ elimination.residual
    n = len(right)
    real, imaginary = right.real, right.imag
    gradient = np.concatenate(
        [real * against[:n] + imaginary * against[n:], real * against[n:] - imaginary * against[:n]]
    )
    return NormalEquations(_summed(right, products), gradient, right, products)


def _summed(right: Complex, products: Real) -> Real:
    """Sum the normal matrices of the responses with the right vector entries ``right`` (n_unknowns, n_responses)."""
    real, imaginary = right.real, right.imag
    n = len(right)
    rr, ri, ii = real @ real.T, real @ imaginary.T, imaginary @ imaginary.T
    uu, uv, vv = products[:n, :n], products[:n, n:], products[n:, n:]
    first = rr * uu + ri * uv + ri.T * uv.T + ii * vv
    second = rr * vv - ri * uv.T - ri.T * uv + ii * uu
    mixed = rr * uv - ri * uu + ri.T * vv - ii * uv.T
    return np.block([[first, mixed], [mixed.T, second]])


def without_response(normal: NormalEquations, left_out: int) -> tuple[Real, Real]:
    """Return matrix and summed gradient with one response left out."""
    alone = _summed(normal.right[:, left_out : left_out + 1], normal.products)
    return normal.matrix - alone, np.asarray(normal.gradient.sum(axis=1) - normal.gradient[:, left_out])


def weighted_matrix(modes: Modes, lines: MeasuredLines, elimination: Elimination, weights: Real) -> Real:
    """Return the matrix of the normal equations with weights (n_rows,) on the squared Jacobian."""
    functions, right = _projected_functions(modes, lines, elimination)
    return _summed(right, functions.T @ (functions * weights[:, None]))


def holds_on_held_out_lines(start: Modes, refined: Modes, lines: MeasuredLines) -> bool:
    """Return whether the refined modes predict held-out lines at least as well as the start does.

    Every fourth line is held out. On the other lines, the linear unknowns of both sets of modes are solved for, and the
    refined modes are refined once more.
    """
    held_out = np.arange(len(lines.s)) % 4 == 2
    fitted, unseen = lines.subset(~held_out), lines.subset(held_out)
    if len(unseen.s) < 2 or not len(start.poles):
        return True
    again = refine(refined, fitted, SETTINGS.held_out_effort)
    before = eliminate(start, fitted)
    return _prediction_error(again.modes, again.elimination, unseen) <= _prediction_error(start, before, unseen)


def _prediction_error(modes: Modes, elimination: Elimination, lines: MeasuredLines) -> float:
    return float(np.sum(np.abs(lines.values - predicted(modes, elimination, lines)) ** 2))


def with_fewest_terms(modes: Modes, lines: MeasuredLines) -> MeasuredLines:
    """Return the lines with the fewest fixed poles outside the band that raise the misfit by at most a tenth.

    A fixed pole represents the contribution of modes outside the band. Where there is no such mode, it biases the
    damping inside: FRFs of milling records contain leakage, which any further term explains in part.
    """
    if len(lines.outer_poles) < 3:
        return lines
    least = refine(modes, lines, SETTINGS.terms_effort).elimination.cost
    for below, above in SETTINGS.fewer_outer_poles:
        candidate = lines.with_fixed_poles(below, above)
        if refine(modes, candidate, SETTINGS.terms_effort).elimination.cost <= SETTINGS.terms_misfit * least:
            return candidate
    return lines
