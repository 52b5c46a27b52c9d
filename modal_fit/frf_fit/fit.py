"""The whole fit of an FRF matrix: candidates, selection, refinement, the test on held-out lines, error bars."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from estimation import Frf
from foundation import MillfrfError

from ..stabilisation import StabilisationChart
from .assembly import exchanged_axes, modal_model, transposed
from .matrix_fit import NOT_REFINED, REFINED, STEPS, TOLERANCE, MatrixFit
from .mode_selection import Candidate, Selection, candidates, hidden_candidates, select_modes
from .spread import mode_errors, unknowns_covariance
from .variable_projection import (
    Elimination,
    MeasuredLines,
    Modes,
    eliminate,
    holds_on_held_out_lines,
    refine,
    with_fewest_terms,
    with_outer_as_residuals,
)
from .variable_projection import inside as inside_band
from .weighting import line_weights, weighted_lines


def fit_matrix(
    frf: Frf, inside: NDArray[np.bool_], band: tuple[float, float], max_order: int, n_modes: int | None
) -> MatrixFit:
    """Fit the lines ``inside`` of an FRF matrix.

    The side with fewer degrees of freedom stands for the references, whose vectors are searched for; the vectors of
    the other side are eliminated. The answer is therefore the same for a matrix and its transpose.

    Raises
    ------
    MillfrfError
        No mode is found.
    """
    with threadpool_limits(1, user_api="blas"):  # many small factorisations: a second thread only waits
        return _fitted(frf, inside, band, max_order, n_modes)


def _fitted(
    frf: Frf, inside: NDArray[np.bool_], band: tuple[float, float], max_order: int, n_modes: int | None
) -> MatrixFit:
    """The fit, on the side with more responses."""
    if len(frf.excitations) > len(frf.responses):
        turned = _fitted(exchanged_axes(frf), inside, band, max_order, n_modes)
        return replace(turned, model=transposed(turned.model))
    chart, found = candidates(frf, band, max_order, line_weights(frf, inside))
    lines, reweigh = weighted_lines(frf, inside, band)

    def look_again(modes: Modes, fitted: MeasuredLines, elimination: Elimination) -> tuple[Candidate, ...]:
        values = np.zeros_like(frf.values)
        values[inside] = _left_over(fitted, elimination)
        left = replace(frf, values=values, valid=inside, covariance=None)
        return (*candidates(left, band, max_order, None)[1], *hidden_candidates(modes, fitted, elimination))

    selection = select_modes(found, lines, reweigh, look_again, n_modes=n_modes)
    if not inside_band(selection.modes, band).any():
        raise MillfrfError(
            f"no pole is stable over orders 1 to {max_order} between {band[0]:g} and {band[1]:g} Hz "
            "and lowers the misfit by more than noise would; widen the band, raise max_order (--max-order) "
            "or average more"
        )
    if lines.stated:
        selection = replace(selection, lines=with_fewest_terms(selection.modes, selection.lines))
    return _finished(frf, chart, selection)


def _finished(frf: Frf, chart: StabilisationChart, selection: Selection) -> MatrixFit:
    """Refine the selected modes on all lines, or keep their start where that does not hold; add error bars."""
    lines = selection.lines
    refined = refine(selection.modes, lines, steps=STEPS, tolerance=TOLERANCE)
    modes, found, status = refined.modes, refined.elimination, REFINED
    start = Modes(np.array([one.pole for one in selection.taken]), modes.left)
    if not holds_on_held_out_lines(start, modes, lines):
        modes, found, status = start, eliminate(start, lines), NOT_REFINED
    freedom = lines.n_values - 2 * found.n_modes * (1 + lines.drive.shape[2]) - found.solution.size
    expected = float(lines.noise.sum())
    chi_square = found.cost * lines.n_values / max(freedom, 1) / expected
    scale = max(1.0, chi_square) if frf.covariance is not None else chi_square
    scale *= 2 * expected / lines.n_values * lines.correlation
    unknowns = unknowns_covariance(modes, lines, found, scale)
    errors = mode_errors(modes, lines, found, unknowns)
    last = {one.pole: (one, reason) for one, reason in selection.refused}
    refused = tuple(one.dropped(reason) for one, reason in last.values())
    model = with_outer_as_residuals(modal_model(frf, modes, found, lines, unknowns, scale, errors))
    return MatrixFit(model, chart, refused, chi_square, status, refined.converged)


def _left_over(lines: MeasuredLines, found: Elimination) -> NDArray[np.complex128]:
    """Give the residual of the FRF matrix in its own unit, (n_lines, n_responses, n_excitations)."""
    error = (found.error[: len(found.error) // 2] + 1j * found.error[len(found.error) // 2 :]).reshape(
        lines.values.shape
    )
    entries = np.linalg.solve(lines.drive, error @ np.linalg.inv(lines.whitening).T)
    return np.asarray(entries.transpose(0, 2, 1))
