"""A fit of poles that somebody picked: no selection; kept as they are, or refined."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from estimation import Frf

from ..models import ModeErrors
from ..stabilisation import StabilisationChart
from .assembly import exchanged_axes, modal_model, transposed
from .matrix_fit import REFINED, STEPS, TOLERANCE, MatrixFit
from .mode_selection import candidates
from .spread import mode_errors, unknowns_covariance
from .variable_projection import Complex, Elimination, MeasuredLines, Modes, Refined, eliminate, participations
from .variable_projection import refine as refine_modes
from .weighting import line_weights, weighted_lines

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
