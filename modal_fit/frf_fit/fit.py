"""Fit of an FRF matrix: weights, candidates, selection, refinement, held-out lines, error bars."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from estimation import Frf
from millfrf.core import Band, Complex, MillfrfError, Real

from ..models.modal_model import ModalModel
from ..models.synthesis import with_outer_as_residuals
from ..settings import SETTINGS
from ..stabilisation import PoleGroup, StabilisationChart
from .assembly import exchanged_axes, modal_model, transposed
from .candidates import Candidate, find_candidates
from .common_errors import with_common_errors
from .elimination import Elimination, Modes, eliminate, participations
from .measured_lines import MeasuredLines, correlated_lines, entry_noise, measured_lines
from .refinement import holds_on_held_out_lines, refine, with_fewest_terms
from .selection import Reweigh, Selection, hidden_candidates, off_columns, peaks_without_mode, select_modes

REFINED = "refined"
NOT_REFINED = "poly-reference poles"
PICKED, PICKED_AND_REFINED = "picked poles, kept", "picked poles, refined"


@dataclass(frozen=True)
class MatrixFit:
    """Modal model fitted to an FRF matrix, with the poles that were considered."""

    model: ModalModel
    chart: StabilisationChart
    dropped: tuple[PoleGroup, ...]  # groups of poles that are no modes, each with its reason
    chi_square: float  # misfit over the expected noise
    status: str  # one of the four texts above
    converged: bool = True
    doubts: tuple[str, ...] = ()  # where modes and stabilisation chart disagree


def fit_matrix(frf: Frf, chosen: NDArray[np.bool_], band: Band, max_order: int, n_modes: int | None) -> MatrixFit:
    """Fit the ``chosen`` lines of an FRF matrix.

    Raises
    ------
    MillfrfError
        No mode is found.
    """
    return _with_more_responses(frf, lambda tall: _automatic_fit(tall, chosen, band, max_order, n_modes))


def fit_picked(
    frf: Frf, chosen: NDArray[np.bool_], band: Band, max_order: int, poles: Complex, *, refine_poles: bool
) -> MatrixFit:
    """Fit the vectors and residual terms of given poles (n_modes,), rad/s, to an FRF matrix.

    The references' vectors are the leading singular vectors of full residue matrices. The right vectors and out-of-band
    terms are then eliminated. Poles that are not refined have no error bars: nothing was estimated.
    """
    return _with_more_responses(
        frf, lambda tall: _picked_fit(tall, chosen, band, max_order, poles, refine_poles=refine_poles)
    )


def _with_more_responses(frf: Frf, fit: Callable[[Frf], MatrixFit]) -> MatrixFit:
    """Apply ``fit`` to the FRF matrix, or to its transpose where it has more excitations than responses.

    The side with fewer degrees of freedom is the reference side, whose vectors are searched for; the vectors of the
    other side are eliminated. A matrix and its transpose therefore give the same modes.
    """
    with threadpool_limits(1, user_api="blas"):  # many small factorisations: a second thread only waits
        if len(frf.excitations) <= len(frf.responses):
            return fit(frf)
        result = fit(exchanged_axes(frf))
        return replace(result, model=transposed(result.model))


def _automatic_fit(frf: Frf, chosen: NDArray[np.bool_], band: Band, max_order: int, n_modes: int | None) -> MatrixFit:
    chart, candidates = find_candidates(frf, band, max_order, _line_weights(frf, chosen))
    lines, reweigh = _weighted_lines(frf, chosen, band)

    def search_residual(modes: Modes, fitted: MeasuredLines, elimination: Elimination) -> tuple[Candidate, ...]:
        values = np.zeros_like(frf.values)
        values[chosen] = _residual(fitted, elimination)
        residual = replace(frf, values=values, valid=chosen, covariance=None)
        polyreference = find_candidates(residual, band, max_order, None)[1]
        return (*polyreference, *hidden_candidates(modes, fitted, elimination))

    selection = select_modes(candidates, lines, reweigh, search_residual, n_modes)
    if not selection.n_inside:
        raise _no_stable_pole(band)
    if lines.has_covariance:
        selection = replace(selection, lines=with_fewest_terms(selection.modes, selection.lines))
    return _finished(frf, chart, selection)


def _no_stable_pole(band: Band) -> MillfrfError:
    return MillfrfError(
        f"no pole is stable over the orders between {band[0]:g} and {band[1]:g} Hz "
        "and lowers the misfit by more than noise would; widen the band, raise max_order (--max-order) "
        "or average more"
    )


def _finished(frf: Frf, chart: StabilisationChart, selection: Selection) -> MatrixFit:
    """Refine the selected modes on all lines and add error bars; drop poles that are no modes and start again.

    Where the refined modes predict held-out lines worse than their start, the start is kept.
    """
    lines = selection.lines
    refined = refine(selection.modes, lines, SETTINGS.final_effort)
    modes, elimination, status = refined.modes, refined.elimination, REFINED
    start = Modes(np.array([candidate.pole for candidate in selection.accepted]), modes.left)
    if not holds_on_held_out_lines(start, modes, lines):
        modes, elimination, status = start, eliminate(start, lines), NOT_REFINED
    model, chi_square = _model_with_errors(frf, modes, elimination, lines)
    if implausible := _implausible(modes, model, lines):
        remaining = replace(selection, modes=refined.modes).without(*implausible)
        if not remaining.n_inside:
            low, high = lines.band
            raise MillfrfError(
                f"no mode between {low:g} and {high:g} Hz; of the last pole, {implausible[1]}; narrow the band to "
                "where the FRFs have clear peaks (--band), or average more"
            )
        return _finished(frf, chart, remaining)
    last = {candidate.pole: (candidate, reason) for candidate, reason in selection.rejected}  # its latest reason
    dropped = tuple(candidate.dropped(reason) for candidate, reason in last.values())
    doubts = tuple(off_columns(modes, selection))
    if len(doubts) == modes.inside(lines.band).sum():
        raise _no_stable_pole(lines.band)
    doubts += tuple(islice(peaks_without_mode(modes, selection), SETTINGS.stated_peaks))
    return MatrixFit(with_outer_as_residuals(model), chart, dropped, chi_square, status, refined.converged, doubts)


def _implausible(modes: Modes, model: ModalModel, lines: MeasuredLines) -> tuple[int, str] | None:
    """Return the number of the mode in the band that is least a mode, with the reason; None where all are modes.

    Only one is named, because the errors of the others shrink without it.
    """
    assert model.errors is not None
    order = np.argsort(np.abs(modes.poles))
    frequency, damping = modes.frequencies[order], modes.damping_ratios[order]
    errors = model.errors.frequency / frequency
    inside = modes.inside(lines.band)[order]
    worst = int(np.argmax(np.where(inside, errors, -1.0)))
    if errors[worst] > SETTINGS.largest_frequency_error:
        return int(order[worst]), f"its frequency is uncertain by {100 * errors[worst]:.0f} %"
    shortest_decay = lines.spacing / (2 * np.pi)  # Hz: half bandwidth of a decay to 1/e within a record of these lines
    for number in np.flatnonzero(inside):
        if damping[number] > SETTINGS.largest_mode_damping:
            return int(order[number]), f"its damping ratio of {damping[number]:.2f} is no vibration"
        if damping[number] < min(model.errors.damping[number], shortest_decay / frequency[number]):
            return int(order[number]), "its damping is zero within its error, as of a tone that does not decay"
    return None


def _picked_fit(
    frf: Frf, chosen: NDArray[np.bool_], band: Band, max_order: int, poles: Complex, *, refine_poles: bool
) -> MatrixFit:
    chart, _ = find_candidates(frf, band, max_order, _line_weights(frf, chosen))
    lines, reweigh = _weighted_lines(frf, chosen, band)
    modes = Modes(poles, participations(poles, lines)).scaled()
    lines = reweigh(lines, eliminate(modes, lines))
    modes = Modes(poles, participations(poles, lines)).scaled()
    if not refine_poles:
        elimination = eliminate(modes, lines)
        chi_square = _chi_square(elimination, lines, elimination.solution.size)
        return MatrixFit(modal_model(frf, modes, elimination, lines), chart, (), chi_square, PICKED)
    # no test on held-out lines may undo the refinement: the user asked for it
    refined = refine(modes, lines, SETTINGS.final_effort)
    model, chi_square = _model_with_errors(frf, refined.modes, refined.elimination, lines)
    return MatrixFit(model, chart, (), chi_square, PICKED_AND_REFINED, refined.converged)


def _model_with_errors(
    frf: Frf, modes: Modes, elimination: Elimination, lines: MeasuredLines
) -> tuple[ModalModel, float]:
    """Return the modal model with standard errors, and its reduced chi-square."""
    n_unknowns = 2 * elimination.n_modes * (1 + lines.drive.shape[2]) + elimination.solution.size
    chi_square = _chi_square(elimination, lines, n_unknowns)
    # a stated noise level is a lower bound; an estimated one is replaced by the misfit
    scale = max(1.0, chi_square) if frf.covariance is not None else chi_square
    scale *= 2 * float(lines.noise.sum()) / lines.n_values * lines.correlation
    model = modal_model(frf, modes, elimination, lines, scale)
    return with_common_errors(model, frf, modes, lines), chi_square


def _chi_square(elimination: Elimination, lines: MeasuredLines, n_unknowns: int) -> float:
    freedom = max(lines.n_values - n_unknowns, 1)
    return elimination.cost * lines.n_values / freedom / float(lines.noise.sum())


def _line_weights(frf: Frf, chosen: NDArray[np.bool_]) -> Real:
    """Return the weights of the lines for the poly-reference poles, the inverse of the noise (n_frequencies,)."""
    if frf.covariance is not None:
        variance = frf.entry_variance()
        assert variance is not None
        summed = variance[chosen].sum(axis=(1, 2))
    else:
        summed = np.mean(_first_variance(frf, chosen) / _typical_power(frf, chosen), axis=(1, 2))
    weights = np.zeros(len(frf.frequencies))
    weights[chosen] = 1 / np.maximum(summed, SETTINGS.least_noise * np.median(summed))
    return weights


def _typical_power(frf: Frf, chosen: NDArray[np.bool_]) -> Real:
    """Return the median power of each entry over the lines, (n_responses, n_excitations); 1 where it is zero."""
    power = np.median(np.abs(frf.values[chosen]) ** 2, axis=0)
    return np.asarray(np.where(power > 0, power, 1.0))


def _first_variance(frf: Frf, chosen: NDArray[np.bool_]) -> Real:
    """Return the variance before anything is fitted: noise, and as misfit the share of the response that errors have.

    The shape is (n_lines, n_responses, n_excitations). Where an integrated acceleration drifts towards 0 Hz, or the
    hammer excites little, the noise is the larger part.
    """
    return entry_noise(frf, chosen) + SETTINGS.needed_share**2 * _typical_power(frf, chosen)


def _weighted_lines(frf: Frf, chosen: NDArray[np.bool_], band: Band) -> tuple[MeasuredLines, Reweigh]:
    """Return the lines with their first weights, and the function that computes the next weights.

    A stated covariance gives fixed weights. Otherwise the residual of an entry in excess of its noise is treated as
    noise of that entry, equal on all lines in the measured quantity. Weights that followed the residual from line to
    line would be smallest at the resonances.
    """
    if frf.covariance is not None:
        return correlated_lines(frf, chosen, band), lambda lines, elimination: lines
    noise = entry_noise(frf, chosen)
    first = measured_lines(frf, chosen, band, _first_variance(frf, chosen))

    def reweigh(lines: MeasuredLines, elimination: Elimination) -> MeasuredLines:
        extra = np.maximum(_entry_misfit(elimination, lines, noise), 0.0)
        return _with_noise(measured_lines(frf, chosen, band, noise + extra), noise)

    return _with_noise(first, noise), reweigh


def _with_noise(lines: MeasuredLines, noise: Real) -> MeasuredLines:
    """Set the expected noise power of the lines to ``noise``, converted to the units of the whitened values.

    An estimate from neighbouring lines is too large where resonances are as narrow as they: on no line more than its
    median counts as noise.
    """
    noise = np.minimum(noise, np.median(noise, axis=0))
    whitened = noise.transpose(0, 2, 1) * lines.weights[:, :, None] ** 2 * np.diag(lines.whitening) ** 2
    return replace(lines, noise=np.asarray(whitened.sum(axis=(1, 2))))


def _entry_misfit(elimination: Elimination, lines: MeasuredLines, noise: Real) -> Real:
    """Return the weighted mean over the lines of squared residual minus noise of each entry, unwhitened.

    The shape is (n_responses, n_excitations). Lines that are mostly noise say little about the misfit of the others.
    """
    squared = (elimination.residual**2).reshape(2, *lines.weights.shape, -1).sum(axis=0)
    weights = lines.weights[:, :, None] ** 2
    excess = squared / np.diag(lines.whitening) ** 2 - weights * noise.transpose(0, 2, 1)
    return np.asarray((excess.sum(axis=0) / weights.sum(axis=0)).T)


def _residual(lines: MeasuredLines, elimination: Elimination) -> Complex:
    """Return the residual of the FRF matrix, unwhitened, (n_lines, n_responses, n_excitations)."""
    real, imaginary = np.split(elimination.residual, 2)
    residual = (real + 1j * imaginary).reshape(lines.values.shape)
    entries = np.linalg.solve(lines.drive, residual @ np.linalg.inv(lines.whitening).T)
    return np.asarray(entries.transpose(0, 2, 1))
