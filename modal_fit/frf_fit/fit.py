"""Fit of an FRF matrix: weights, candidates, selection, refinement, held-out lines, error bars."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from estimation import Frf
from millfrf.core import Complex, MillfrfError, Real

from ..models.modal_model import ModalModel, ModeErrors
from ..stabilisation import PoleGroup, StabilisationChart
from .assembly import exchanged_axes, modal_model, mode_errors, transposed, unknowns_covariance
from .elimination import Elimination, Modes, eliminate, participations, with_outer_as_residuals
from .elimination import inside as inside_band
from .measured_lines import MeasuredLines, correlated_lines, entry_noise, measured_lines
from .refinement import Refined, holds_on_held_out_lines, refine, with_fewest_terms
from .refinement import refine as refine_modes
from .selection import Reweigh, Selection, hidden_candidates, select_modes
from .steady_poles import Candidate, candidates

STEPS = 40
"""Steps of a refinement at most."""

TOLERANCE = 1e-7
"""Relative fall of the misfit below which a refinement ends."""

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


def line_weights(frf: Frf, inside: NDArray[np.bool_]) -> NDArray[np.float64] | None:
    """Weights of the lines for the poly-reference poles, from the stated noise; None where no noise is stated.

    Parameters
    ----------
    frf
        The measured FRF matrix.
    inside : (n_frequencies,)
        Which lines are fitted; all others have the weight zero.
    """
    variance = frf.entry_variance() if frf.covariance is not None else None
    if variance is None:
        return None
    summed = variance[inside].sum(axis=(1, 2))
    weights = np.zeros(len(frf.frequencies))
    weights[inside] = 1 / np.maximum(summed, 1e-3 * np.median(summed))
    return weights


def weighted_lines(frf: Frf, inside: NDArray[np.bool_], band: tuple[float, float]) -> tuple[MeasuredLines, Reweigh]:
    """The lines with their first weights, and the rule for the next ones.

    A stated covariance stays. Else each entry counts alike at first; then what a fit leaves of an entry beyond its
    noise is taken for flat noise of that entry, in the measured quantity. Flat, because an error that follows the
    resonances, which a misfit does, would take the weight from them.

    Parameters
    ----------
    frf
        The measured FRF matrix.
    inside : (n_frequencies,)
        Which lines are fitted.
    band
        Lower and upper edge of the band (Hz).
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


def _entry_misfit(found: Elimination, lines: MeasuredLines) -> Real:
    """Mean squared misfit of each entry, in its own unit, (n_responses, n_excitations)."""
    n_lines, n_columns = lines.weights.shape
    squared = (found.error**2).reshape(2, n_lines, n_columns, -1).sum(axis=0) / lines.weights[:, :, None] ** 2
    return np.asarray(squared.mean(axis=0).T / np.diag(lines.whitening)[:, None] ** 2)


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


KEPT = "picked poles"


def fit_picked(
    frf: Frf, inside: NDArray[np.bool_], band: tuple[float, float], max_order: int, poles: Complex, *, refine: bool
) -> MatrixFit:
    """Fit an FRF matrix with given poles; vectors and residuals are linear in it.

    The references' vectors come from full residue matrices, of which the leading singular vector is taken; with them
    given, all that belongs to one response is eliminated. Kept poles have no error bars: nothing was estimated.

    Parameters
    ----------
    frf, inside, band
        FRF, lines to use and band (Hz), as in :func:`fit_matrix`.
    max_order
        Highest order of the stabilisation chart beside the fit.
    poles : (n_modes,), rad/s
        Poles to keep, in the upper half plane.
    refine
        Whether poles and vectors are refined from there, as those of an automatic fit are.
    """
    with threadpool_limits(1, user_api="blas"):  # many small factorisations: a second thread only waits
        return _picked(frf, inside, band, max_order, poles, refine=refine)


def _picked(
    frf: Frf, inside: NDArray[np.bool_], band: tuple[float, float], max_order: int, poles: Complex, *, refine: bool
) -> MatrixFit:
    """Fit picked poles on the side with more responses."""
    if len(frf.excitations) > len(frf.responses):
        turned = _picked(exchanged_axes(frf), inside, band, max_order, poles, refine=refine)
        return replace(turned, model=transposed(turned.model))
    chart, _ = candidates(frf, band, max_order, line_weights(frf, inside))
    lines, reweigh = weighted_lines(frf, inside, band)
    modes = Modes(poles, participations(poles, lines)).scaled()
    lines = reweigh(lines, eliminate(modes, lines))
    modes = Modes(poles, participations(poles, lines)).scaled()
    if not refine:
        return _kept(frf, chart, modes, eliminate(modes, lines), lines)
    refined = refine_modes(modes, lines, steps=STEPS, tolerance=TOLERANCE)
    return _refined(frf, chart, refined, lines)


def _kept(frf: Frf, chart: StabilisationChart, modes: Modes, found: Elimination, lines: MeasuredLines) -> MatrixFit:
    n, free = len(modes.poles), len(modes.poles) + len(modes.free())
    unknown = np.zeros((n, 2))
    errors = ModeErrors(unknown, unknown, unknown, unknown)
    model = modal_model(frf, modes, found, lines, np.zeros((2 * free, 2 * free)), 0.0, errors)
    chi_square = _chi_square(found, lines, found.solution.size)
    return MatrixFit(replace(model, covariance=None, errors=None), chart, (), chi_square, KEPT, True)


def _refined(frf: Frf, chart: StabilisationChart, refined: Refined, lines: MeasuredLines) -> MatrixFit:
    """Refine picked poles and give them error bars; no test on other lines may undo it, as the user asked for it."""
    modes, found = refined.modes, refined.elimination
    n_left = 2 * found.n_modes * (1 + lines.drive.shape[2])
    chi_square = _chi_square(found, lines, n_left + found.solution.size)
    scale = max(1.0, chi_square) if frf.covariance is not None else chi_square
    scale *= 2 * float(lines.noise.sum()) / lines.n_values * lines.correlation
    unknowns = unknowns_covariance(modes, lines, found, scale)
    errors = mode_errors(modes, lines, found, unknowns)
    model = modal_model(frf, modes, found, lines, unknowns, scale, errors)
    return MatrixFit(model, chart, (), chi_square, REFINED, refined.converged)


def _chi_square(found: Elimination, lines: MeasuredLines, n_parameters: int) -> float:
    """Misfit over the noise expected."""
    freedom = max(lines.n_values - n_parameters, 1)
    return found.cost * lines.n_values / freedom / float(lines.noise.sum())
