"""The whole fit of an FRF matrix: candidates, selection, refinement, the test on held-out lines, error bars."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from estimation import Frf, FrfCovariance
from foundation import MillfrfError

from ..models import ModalModel
from ..stabilisation import PoleGroup, StabilisationChart
from .assembly import modal_model, transposed
from .mode_selection import Candidate, Reweigh, Selection, candidates, hidden_candidates, select_modes
from .spread import mode_errors, unknowns_covariance
from .variable_projection import (
    Elimination,
    MeasuredLines,
    Modes,
    Real,
    correlated_lines,
    eliminate,
    entry_noise,
    holds_on_held_out_lines,
    measured_lines,
    refine,
    with_fewest_terms,
    with_outer_as_residuals,
)
from .variable_projection import inside as inside_band

_STEPS, _TOLERANCE = 40, 1e-7

REFINED = "refined"
NOT_REFINED = "poly-reference poles"


@dataclass(frozen=True)
class MatrixFit:
    """A fit of an FRF matrix.

    Parameters
    ----------
    model
        Modes, residuals, errors.
    chart
        Poles over order.
    refused
        Groups of poles that are no modes, each with its reason.
    chi_square
        Misfit over the noise expected.
    status
        ``refined``, or ``poly-reference poles`` where the refinement did not hold on held-out lines.
    converged
        Whether the refinement came to its end.
    """

    model: ModalModel
    chart: StabilisationChart
    refused: tuple[PoleGroup, ...]
    chi_square: float
    status: str
    converged: bool


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
        turned = _fitted(_exchanged(frf), inside, band, max_order, n_modes)
        return replace(turned, model=transposed(turned.model))
    chart, found = candidates(frf, band, max_order, _line_weights(frf, inside))
    lines, reweigh = _weighted(frf, inside, band)

    def look_again(modes: Modes, fitted: MeasuredLines, elimination: Elimination) -> tuple[Candidate, ...]:
        values = np.zeros_like(frf.values)
        values[inside] = _left_over(fitted, elimination)
        left = replace(frf, values=values, valid=inside, covariance=None)
        return (*candidates(left, band, max_order, None)[1], *hidden_candidates(modes, fitted, elimination))

    selection = select_modes(found, lines, reweigh, look_again, n_modes=n_modes)
    if not inside_band(selection.modes, band).any():
        raise MillfrfError(
            f"no pole is stable over orders 1 to {max_order} between {band[0]:g} and {band[1]:g} Hz "
            "and lowers the misfit by more than noise would; widen the band, raise --max-order or average more"
        )
    if lines.stated:
        selection = replace(selection, lines=with_fewest_terms(selection.modes, selection.lines))
    return _finished(frf, chart, selection)


def _finished(frf: Frf, chart: StabilisationChart, selection: Selection) -> MatrixFit:
    """Refine the selected modes on all lines, or keep their start where that does not hold; add error bars."""
    lines = selection.lines
    refined = refine(selection.modes, lines, steps=_STEPS, tolerance=_TOLERANCE)
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


def _weighted(frf: Frf, inside: NDArray[np.bool_], band: tuple[float, float]) -> tuple[MeasuredLines, Reweigh]:
    """The lines with their first weights, and the rule for the next ones.

    A stated covariance stays. Else each entry counts alike at first; then what a fit leaves of an entry beyond its
    noise is taken for flat noise of that entry, in the measured quantity. Flat, because an error that follows the
    resonances, which a misfit does, would take the weight from them.
    """
    if frf.covariance is not None:
        return correlated_lines(frf, inside, band), _unchanged
    noise = entry_noise(frf, inside)
    power = np.mean(np.abs(frf.values[inside]) ** 2, axis=0)
    first = measured_lines(frf, inside, band, np.broadcast_to(np.where(power > 0, power, 1.0), noise.shape))
    first = replace(first, noise=_noise_power(noise, first))

    def reweigh(lines: MeasuredLines, found: Elimination) -> MeasuredLines:
        misfit = _entry_misfit(found, lines)
        extra = np.maximum(misfit - noise.mean(axis=0), 0.0)
        again = measured_lines(frf, inside, band, noise + extra)
        return replace(again, noise=_noise_power(noise, again))

    return first, reweigh


def _unchanged(lines: MeasuredLines, found: Elimination) -> MeasuredLines:
    return lines


def _noise_power(noise: Real, lines: MeasuredLines) -> Real:
    """Power of the noise alone on each line, in the units of the whitened values."""
    whitened = noise.transpose(0, 2, 1) * lines.weights[:, :, None] ** 2 * np.diag(lines.whitening) ** 2
    return np.asarray(whitened.sum(axis=(1, 2)))


def _left_over(lines: MeasuredLines, found: Elimination) -> NDArray[np.complex128]:
    """Give the residual of the FRF matrix in its own unit, (n_lines, n_responses, n_excitations)."""
    error = (found.error[: len(found.error) // 2] + 1j * found.error[len(found.error) // 2 :]).reshape(
        lines.values.shape
    )
    entries = np.linalg.solve(lines.drive, error @ np.linalg.inv(lines.whitening).T)
    return np.asarray(entries.transpose(0, 2, 1))


def _entry_misfit(found: Elimination, lines: MeasuredLines) -> Real:
    """Mean squared misfit of each entry, in its own unit, (n_responses, n_excitations)."""
    n_lines, n_columns = lines.weights.shape
    squared = (found.error**2).reshape(2, n_lines, n_columns, -1).sum(axis=0) / lines.weights[:, :, None] ** 2
    return np.asarray(squared.mean(axis=0).T / np.diag(lines.whitening)[:, None] ** 2)


def _line_weights(frf: Frf, inside: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Weights of the lines for the poly-reference poles, from the stated noise."""
    variance = frf.entry_variance() if frf.covariance is not None else None
    if variance is None:
        return None
    summed = variance[inside].sum(axis=(1, 2))
    weights = np.zeros(len(frf.frequencies))
    weights[inside] = 1 / np.maximum(summed, 1e-3 * np.median(summed))
    return weights


def _exchanged(frf: Frf) -> Frf:
    """The transposed matrix with exchanged axes."""
    covariance = frf.covariance
    return replace(
        frf,
        values=frf.values.transpose(0, 2, 1),
        responses=frf.excitations,
        excitations=frf.responses,
        multiple_coherence=None,
        coherence=None if frf.coherence is None else frf.coherence.transpose(0, 2, 1),
        averages=None if frf.averages is None else frf.averages.T,
        covariance=None if covariance is None else FrfCovariance(covariance.excitation, covariance.response),
    )
