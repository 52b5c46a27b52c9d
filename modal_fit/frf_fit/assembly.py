"""Assembly of a `ModalModel` from whitened modes, with covariance and error bars."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from estimation import Frf, FrfCovariance
from millfrf.core import Index, Real

from ..models.modal_model import ModalModel, ModeErrors
from ..models.out_of_band import residuals_from
from ..settings import SETTINGS
from .elimination import Elimination, Modes, derivatives
from .measured_lines import MeasuredLines, half_power_lines
from .refinement import normal_equations, refine, weighted_matrix, without_response


def modal_model(
    frf: Frf, modes: Modes, elimination: Elimination, lines: MeasuredLines, noise_scale: float | None = None
) -> ModalModel:
    """Assemble the modal model of the receptance, with the modes in order of frequency and residual terms.

    Parameters
    ----------
    frf
        Fitted FRF, which gives axes and quantity.
    modes, elimination, lines
        Modes, linear unknowns and lines of the fit.
    noise_scale
        Variance of a whitened complex value; None: without standard errors and covariance.
    """
    order = np.argsort(np.abs(modes.poles))
    unwhitening = np.asarray(np.linalg.inv(lines.whitening), dtype=np.float64)
    n_excitations = lines.drive.shape[2]
    coefficients = (elimination.out_of_band @ unwhitening.T).reshape(len(lines.basis), n_excitations, -1)
    covariance, errors = None, None
    if noise_scale is not None:
        unknowns = _unknowns_covariance(modes, lines, elimination, noise_scale)
        errors = _mode_errors(modes, lines, elimination, unknowns)
        n_parameters = 2 * len(modes.poles) * (1 + lines.values.shape[2] + n_excitations)
        if n_parameters <= SETTINGS.most_parameters:
            covariance = _covariance(modes, elimination, lines, unknowns, noise_scale, unwhitening)
            covariance = _widened(covariance, modes, errors)
            index = _sorting_index(modes, elimination, order)
            covariance = covariance[np.ix_(index, index)]
    is_transfer = frf.quantity == "transfer"
    return ModalModel(
        poles=modes.poles[order],
        right=np.asarray(elimination.right @ unwhitening.T)[order],
        left=modes.left[order],
        responses=frf.responses,
        excitations=frf.excitations,
        quantity="transfer" if is_transfer else "receptance",
        unit=frf.unit if is_transfer else "m/N",
        residuals=residuals_from(coefficients.transpose(0, 2, 1), lines.band, lines.outer_poles),
        covariance=covariance,
        band=lines.band,
        errors=None if errors is None else errors.ordered(order),
    )


def exchanged_axes(frf: Frf) -> Frf:
    """Return the transposed FRF matrix: responses and excitations exchanged."""
    covariance = frf.covariance
    return replace(
        frf,
        values=frf.values.transpose(0, 2, 1),
        responses=frf.excitations,
        excitations=frf.responses,
        multiple_coherence=None,
        coherence=None if frf.coherence is None else frf.coherence.transpose(0, 2, 1),
        averages=None if frf.averages is None else frf.averages.T,
        measured=None if frf.measured is None else frf.measured.T,
        common_errors=None if frf.common_errors is None else frf.common_errors.swapaxes(2, 3),
        covariance=None if covariance is None else FrfCovariance(covariance.excitation, covariance.response),
    )


def transposed(model: ModalModel) -> ModalModel:
    """Return the model with responses and excitations exchanged."""
    residuals, covariance = model.residuals, model.covariance
    if residuals is not None:
        residues = None if residuals.residues is None else residuals.residues.transpose(0, 2, 1)
        residuals = replace(residuals, upper=residuals.upper.T, lower=residuals.lower.T, residues=residues)
    if covariance is not None:
        ends = np.cumsum([2 * model.poles.size, 2 * model.right.size])
        poles, right, left = np.split(np.arange(len(covariance)), ends)
        index = np.concatenate([poles, left, right])
        covariance = covariance[np.ix_(index, index)]
    return replace(
        model,
        right=model.left,
        left=model.right,
        responses=model.excitations,
        excitations=model.responses,
        residuals=residuals,
        covariance=covariance,
        measured=None if model.measured is None else model.measured.T,
    )


def _covariance(
    modes: Modes, elimination: Elimination, lines: MeasuredLines, unknowns: Real, scale: float, unwhitening: Real
) -> Real:
    """Return the covariance of Re poles, Im poles, Re right, Im right, Re left, Im left, each mode by mode."""
    n, n_responses = len(modes.poles), lines.values.shape[2]
    slopes = _right_by_unknowns(modes, elimination, lines)  # (2n, n_responses, n_unknowns): real parts, then imaginary
    slopes = np.einsum("up,apz->auz", unwhitening, slopes)
    by_unknowns = _parameters_by_unknowns(modes, slopes, len(unknowns))
    covariance = by_unknowns @ unknowns @ by_unknowns.T
    # noise of the right vectors with poles and left vectors fixed
    inverse = np.linalg.pinv(elimination.triangle)[: 2 * n] / elimination.scale[: 2 * n, None]
    own = 0.5 * scale * inverse @ inverse.T
    vectors = np.einsum("ab,pu->apbu", own, unwhitening @ unwhitening.T).reshape(2 * n * n_responses, -1)
    block = slice(2 * n, 2 * n + len(vectors))
    covariance[block, block] += vectors
    return np.asarray(covariance)


def _right_by_unknowns(modes: Modes, elimination: Elimination, lines: MeasuredLines) -> Real:
    """Return the derivatives of the eliminated right vectors by poles and free left entries.

    The shape is (2 n_modes, n_responses, n_unknowns): real parts of the vectors, then imaginary parts.
    """
    functions, owners = derivatives(modes, lines)
    n = len(owners)
    inverse = np.linalg.pinv(elimination.triangle) / elimination.scale[:, None]
    moved = -(inverse @ (elimination.orthogonal.T @ functions))[: 2 * elimination.n_modes]
    right = elimination.right[owners]
    u, v = moved[:, :n], moved[:, n:]
    by_real = np.einsum("az,zp->apz", u, right.real) + np.einsum("az,zp->apz", v, right.imag)
    by_imaginary = np.einsum("az,zp->apz", v, right.real) - np.einsum("az,zp->apz", u, right.imag)
    return np.concatenate([by_real, by_imaginary], axis=2)


def _parameters_by_unknowns(modes: Modes, right_slopes: Real, n_unknowns: int) -> Real:
    """Return the derivatives of all model parameters by the unknowns.

    ``right_slopes`` holds the derivatives of the right vectors.
    """
    n, n_excitations = modes.left.shape
    half = n_unknowns // 2
    rows = np.zeros((2 * n + right_slopes.shape[0] * right_slopes.shape[1] + 2 * n * n_excitations, n_unknowns))
    rows[np.arange(n), np.arange(n)] = 1.0
    rows[n + np.arange(n), half + np.arange(n)] = 1.0
    first_left = len(rows) - 2 * n * n_excitations
    rows[2 * n : first_left] = right_slopes.reshape(-1, n_unknowns)
    for number, (mode, column) in enumerate(modes.free(), start=n):
        rows[first_left + mode * n_excitations + column, number] = 1.0
        rows[first_left + n * n_excitations + mode * n_excitations + column, half + number] = 1.0
    return rows


def _widened(covariance: Real, modes: Modes, errors: ModeErrors) -> Real:
    """Scale the covariance of each pole so that frequency and damping get at least their total error."""
    n = len(modes.poles)
    noise = np.where(errors.noise > 0, errors.noise, 1.0)
    factor = np.max(np.where(errors.noise > 0, errors.total / noise, 1.0), axis=1)
    widening = np.ones(len(covariance))
    widening[: 2 * n] = np.tile(factor, 2)
    return np.asarray(covariance * np.outer(widening, widening))


def _sorting_index(modes: Modes, elimination: Elimination, order: Index) -> Index:
    """Return the place that each parameter of the sorted model has in the unsorted model."""
    n = len(order)
    pieces, first = [], 0
    for width in (1, 1, *[elimination.residual.shape[1]] * 2, *[modes.left.shape[1]] * 2):
        block = first + np.arange(n * width).reshape(n, width)
        pieces.append(block[order].ravel())
        first += n * width
    return np.concatenate(pieces)


def _mode_errors(modes: Modes, lines: MeasuredLines, elimination: Elimination, unknowns: Real) -> ModeErrors:
    """Return the standard errors of each mode by source.

    ``unknowns`` is the covariance of the unknowns due to noise.
    """
    poles = _pole_index(modes, len(unknowns))
    by_pole = _by_pole(modes)
    covariance = unknowns[np.ix_(poles, poles)]
    noise = np.sqrt(np.maximum(np.einsum("rxi,ij,rxj->rx", by_pole, covariance, by_pole), 0.0))
    return ModeErrors(
        noise,
        _jackknife(modes, lines, elimination, by_pole),
        _scatter(modes, _narrowed(modes, lines)),
        _scatter(modes, _other_terms(lines)),
    )


def _pole_index(modes: Modes, n_real: int) -> Index:
    """Return the indices of the poles among ``n_real`` real unknowns: real parts first, then imaginary parts."""
    n = len(modes.poles)
    return np.concatenate([np.arange(n), n_real // 2 + np.arange(n)])


def _by_pole(modes: Modes) -> Real:
    """Return the derivatives of frequency (Hz) and damping ratio of each mode by all poles, shape (n, 2, 2n).

    The poles count as n real parts, then n imaginary parts.
    """
    n, size = len(modes.poles), np.abs(modes.poles)
    real, imaginary = modes.poles.real, modes.poles.imag
    derivative = np.zeros((n, 2, 2 * n))
    rows = np.arange(n)
    derivative[rows, 0, rows], derivative[rows, 0, n + rows] = real / size / (2 * np.pi), imaginary / size / (2 * np.pi)
    derivative[rows, 1, rows] = -(imaginary**2) / size**3
    derivative[rows, 1, n + rows] = real * imaginary / size**3
    return derivative


def _jackknife(modes: Modes, lines: MeasuredLines, elimination: Elimination, by_pole: Real) -> Real:
    """Estimate standard errors by leaving out one response at a time.

    Each refit is approximated by one Gauss-Newton step from the optimum.
    """
    n, n_responses = len(modes.poles), lines.values.shape[2]
    if n_responses < 4:  # too few to estimate a scatter
        return np.full((n, 2), np.nan)
    normal = normal_equations(modes, lines, elimination)
    scale = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    poles = _pole_index(modes, len(scale))
    changes = []
    # a complete refit for each response would cost as many refinements as there are responses
    for left_out in range(n_responses):
        matrix, gradient = without_response(normal, left_out)
        regular = matrix / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
        step = np.linalg.solve(regular, gradient / scale) / scale
        changes.append(by_pole @ step[poles])
    scatter = np.var(np.array(changes), axis=0) * (n_responses - 1)
    return np.asarray(np.sqrt(scatter))


def _narrowed(modes: Modes, lines: MeasuredLines) -> Iterator[MeasuredLines]:
    """Yield the lines with the lower, then the upper edge of the band moved inwards, unless a mode loses lines."""
    low, high = lines.frequencies[0], lines.frequencies[-1]
    step = SETTINGS.edge_step * (high - low)
    for inside in (lines.frequencies >= low + step, lines.frequencies <= high - step):
        if not any((half_power_lines(complex(pole), lines) & ~inside).any() for pole in modes.poles):
            yield lines.subset(inside)


def _other_terms(lines: MeasuredLines) -> Iterator[MeasuredLines]:
    """Yield the lines with other places, or another number, of the fixed poles outside the band."""
    all_poles = len(lines.outer_poles) == 3
    for below, above in SETTINGS.other_outer_poles if all_poles else SETTINGS.more_or_fewer_outer_poles:
        yield lines.with_fixed_poles(below, above)


def _scatter(modes: Modes, variants: Iterable[MeasuredLines]) -> Real:
    """Refine the modes on each variant of the lines; return the root mean square changes, shape (n_modes, 2).

    Column 0 holds the change of the frequency (Hz), column 1 of the damping ratio.
    """
    others = [refine(modes, lines, SETTINGS.error_effort).modes for lines in variants]
    if not others:
        return np.full((len(modes.poles), 2), np.nan)
    changes = [
        np.stack([other.frequencies - modes.frequencies, other.damping_ratios - modes.damping_ratios], axis=1)
        for other in others
    ]
    return np.asarray(np.sqrt(np.mean(np.square(changes), axis=0)))


def _unknowns_covariance(modes: Modes, lines: MeasuredLines, elimination: Elimination, scale: float) -> Real:
    """Return the covariance of the real unknowns: real parts of poles and free left entries, then imaginary parts.

    It is ``M^-1 (sum over lines of J^T v J) M^-1``, with J the Jacobian, M the normal matrix and v the squared residual
    around each line. Noise that is stronger at resonances therefore widens the error bars of the modes there (White,
    Econometrica 48, 1980). ``scale`` is the variance of a whitened complex value, half of it in the real part.
    """
    level = _smoothed(elimination.power(lines))
    level = level / max(float(level.mean()), 1e-300)
    normal = normal_equations(modes, lines, elimination)
    size = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    inverse = np.linalg.pinv(normal.matrix / np.outer(size, size), hermitian=True) / np.outer(size, size)
    per_row = np.tile(np.repeat(level, lines.drive.shape[1]), 2)
    return np.asarray(0.5 * scale * inverse @ weighted_matrix(modes, lines, elimination, per_row) @ inverse)


def _smoothed(level: Real) -> Real:
    """Return the running mean over nine lines, mirrored at the ends."""
    reach = min(4, (len(level) - 1) // 2)
    width = 2 * reach + 1
    return np.asarray(np.convolve(np.pad(level, reach, "reflect"), np.ones(width) / width, "valid"))
