"""Assembly of a `ModalModel` from whitened modes, with covariance and error bars."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance
from millfrf.core import Real

from ..models.modal_model import ModalModel, ModeErrors
from ..models.out_of_band import residuals_with_poles
from .elimination import Elimination, Modes, derivatives, half_power_lines
from .measured_lines import MeasuredLines
from .refinement import normal_equations, refine, weighted_matrix, with_fixed_poles, without_response

_MOST_PARAMETERS = 700  # with a covariance matrix: its file would pass 10 MB


def modal_model(
    frf: Frf,
    modes: Modes,
    found: Elimination,
    lines: MeasuredLines,
    unknowns: Real,
    scale: float,
    errors: ModeErrors,
) -> ModalModel:
    """Assemble the modal model of receptance: modes in order of frequency, with residual terms.

    Parameters
    ----------
    frf
        Fitted FRF, which gives axes and quantity.
    modes, found, lines
        Modes, elimination and lines of the fit.
    unknowns : (2 n_unknowns, 2 n_unknowns)
        Covariance of poles and free left entries by the noise.
    scale
        Variance of a whitened complex value.
    errors
        Standard errors of frequencies and dampings; the covariance is widened to them.
    """
    order = np.argsort(np.abs(modes.poles))
    back = np.asarray(np.linalg.inv(lines.whitening), dtype=np.float64)
    n_excitations = lines.drive.shape[2]
    outside = (found.outside @ back.T).reshape(len(lines.basis), n_excitations, -1).transpose(0, 2, 1)
    n_parameters = 2 * len(modes.poles) * (1 + lines.values.shape[2] + n_excitations)
    covariance = None
    if n_parameters <= _MOST_PARAMETERS:
        covariance = _widened(_covariance(modes, found, lines, unknowns, scale, back), modes, errors)
        index = _sorting_index(modes, found, order)
        covariance = covariance[np.ix_(index, index)]
    transfer = frf.quantity == "transfer"
    return ModalModel(
        poles=modes.poles[order],
        right=np.asarray(found.right @ back.T)[order],
        left=modes.left[order],
        responses=frf.responses,
        excitations=frf.excitations,
        quantity="transfer" if transfer else "receptance",
        unit=frf.unit if transfer else "m/N",
        residuals=residuals_with_poles(outside, lines.band, lines.outside_poles),
        covariance=covariance,
        band=lines.band,
        errors=errors.ordered(order),
    )


def exchanged_axes(frf: Frf) -> Frf:
    """The transposed FRF matrix: responses and excitations change places.

    Parameters
    ----------
    frf
        The measured FRF matrix.
    """
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


def transposed(model: ModalModel) -> ModalModel:
    """The model with responses and excitations exchanged."""
    residuals = model.residuals
    if residuals is not None:
        residues = None if residuals.residues is None else residuals.residues.transpose(0, 2, 1)
        residuals = replace(residuals, upper=residuals.upper.T, lower=residuals.lower.T, residues=residues)
    covariance = model.covariance
    if covariance is not None:
        poles, right, left = np.split(
            np.arange(len(covariance)), np.cumsum([2 * model.poles.size, 2 * model.right.size])
        )
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
    )


def _covariance(
    modes: Modes, found: Elimination, lines: MeasuredLines, unknowns: Real, scale: float, back: Real
) -> Real:
    """Give the covariance of Re poles, Im poles, Re right, Im right, Re left, Im left, each mode by mode."""
    n, n_responses = len(modes.poles), lines.values.shape[2]
    turned = _right_by_unknowns(modes, found, lines)  # (2n, n_responses, n_unknowns): real parts, then imaginary
    turned = np.einsum("up,apz->auz", back, turned)
    inverse = np.linalg.pinv(found.triangle)[: 2 * n] / found.scale[: 2 * n, None]
    own = 0.5 * scale * inverse @ inverse.T
    by_unknowns = _placed(modes, turned, len(unknowns))
    covariance = by_unknowns @ unknowns @ by_unknowns.T
    vectors = np.einsum("ab,pu->apbu", own, back @ back.T).reshape(2 * n * n_responses, -1)
    first = 2 * n
    covariance[first : first + len(vectors), first : first + len(vectors)] += vectors
    return np.asarray(covariance)


def _right_by_unknowns(modes: Modes, found: Elimination, lines: MeasuredLines) -> Real:
    """Change of the eliminated right vectors with poles and free left entries, (2 n_modes, n_responses, n_unknowns)."""
    functions, owners = derivatives(modes, lines)
    n = len(owners)
    inverse = np.linalg.pinv(found.triangle) / found.scale[:, None]
    moved = -(inverse @ (found.orthogonal.T @ functions))[: 2 * found.n_modes]
    real, imaginary = found.right[owners].real, found.right[owners].imag
    by_real = np.einsum("az,zp->apz", moved[:, :n], real) + np.einsum("az,zp->apz", moved[:, n:], imaginary)
    by_imaginary = np.einsum("az,zp->apz", moved[:, n:], real) - np.einsum("az,zp->apz", moved[:, :n], imaginary)
    return np.concatenate([by_real, by_imaginary], axis=2)


def _placed(modes: Modes, turned: Real, n_unknowns: int) -> Real:
    """Derivative of all parameters of the model by the unknowns."""
    n, n_excitations = modes.left.shape
    half = n_unknowns // 2
    rows = np.zeros((2 * n + turned.shape[0] * turned.shape[1] + 2 * n * n_excitations, n_unknowns))
    rows[np.arange(n), np.arange(n)] = 1.0
    rows[n + np.arange(n), half + np.arange(n)] = 1.0
    rows[2 * n : 2 * n + turned.shape[0] * turned.shape[1]] = turned.reshape(-1, n_unknowns)
    first = len(rows) - 2 * n * n_excitations
    for number, (mode, column) in enumerate(modes.free(), start=n):
        rows[first + mode * n_excitations + column, number] = 1.0
        rows[first + n * n_excitations + mode * n_excitations + column, half + number] = 1.0
    return rows


def _widened(covariance: Real, modes: Modes, errors: ModeErrors) -> Real:
    """Scale rows and columns of each mode so that its frequency and damping have their total error."""
    n = len(modes.poles)
    noise = np.where(errors.noise > 0, errors.noise, 1.0)
    factor = np.max(np.where(errors.noise > 0, errors.total / noise, 1.0), axis=1)
    widening = np.ones(len(covariance))
    widening[: 2 * n] = np.tile(factor, 2)
    return np.asarray(covariance * np.outer(widening, widening))


def _sorting_index(modes: Modes, found: Elimination, order: NDArray[np.int64]) -> NDArray[np.int64]:
    """Give the place in the unsorted model of each parameter of the sorted one."""
    n = len(order)
    pieces, first = [], 0
    for width in (1, found.error.shape[1], modes.left.shape[1]):
        for _ in range(2):
            block = first + np.arange(n * width).reshape(n, width)
            pieces.append(block[order].ravel())
            first += n * width
    return np.concatenate(pieces)


_EDGE = 0.05  # of the band
_OTHER_POLES = (((0.5,), (1.6, 4.0)), ((0.85,), (1.15, 2.0)))  # of the band's lower and upper end
_TO_FEWER = (((0.7,), (1.3, 3.0)), ((), (2.0,)))  # where the fit has fewer than three fixed poles
_ALL_POLES = 3
_STEPS, _TOLERANCE = 8, 1e-5
_FEWEST_RESPONSES = 4
_SMOOTH = 4  # lines to each side over which the squared error is averaged


def mode_errors(modes: Modes, lines: MeasuredLines, found: Elimination, unknowns: Real) -> ModeErrors:
    """Compute standard errors of each mode, by their source.

    Parameters
    ----------
    modes, lines, found
        Modes, lines and elimination of the fit.
    unknowns : (2 n_unknowns, 2 n_unknowns)
        Covariance of poles and free left entries by the noise.
    """
    n = len(modes.poles)
    n_unknowns = len(unknowns) // 2
    of_poles = np.r_[0:n, n_unknowns : n_unknowns + n]
    by_pole = _by_pole(modes)
    covariance = unknowns[np.ix_(of_poles, of_poles)]
    noise = np.sqrt(np.maximum(np.einsum("rxi,ij,rxj->rx", by_pole, covariance, by_pole), 0.0))
    return ModeErrors(
        noise,
        _over_points(modes, lines, found, by_pole),
        _scatter(modes, _narrowed(modes, lines)),
        _scatter(modes, _other_terms(lines)),
    )


def _by_pole(modes: Modes) -> Real:
    """Derivative of frequency (Hz) and damping ratio by (real parts, imaginary parts) of poles, (n, 2, 2n)."""
    n, size = len(modes.poles), np.abs(modes.poles)
    real, imaginary = modes.poles.real, modes.poles.imag
    derivative = np.zeros((n, 2, 2 * n))
    rows = np.arange(n)
    derivative[rows, 0, rows], derivative[rows, 0, n + rows] = real / size / (2 * np.pi), imaginary / size / (2 * np.pi)
    derivative[rows, 1, rows] = -(imaginary**2) / size**3
    derivative[rows, 1, n + rows] = real * imaginary / size**3
    return derivative


def _over_points(modes: Modes, lines: MeasuredLines, found: Elimination, by_pole: Real) -> Real:
    """Jackknife over the responses, each left out by one Gauss-Newton step from the optimum of all."""
    n, n_responses = len(modes.poles), lines.values.shape[2]
    if n_responses < _FEWEST_RESPONSES:
        return np.full((n, 2), np.nan)
    normal = normal_equations(modes, lines, found)
    scale = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    n_unknowns = len(scale) // 2
    of_poles = np.r_[0:n, n_unknowns : n_unknowns + n]
    moved = []
    for left_out in range(n_responses):
        matrix, gradient = without_response(normal, left_out)
        regular = matrix / np.outer(scale, scale) + 1e-9 * np.eye(len(scale))
        step = np.linalg.solve(regular, gradient / scale) / scale
        moved.append(by_pole @ step[of_poles])
    scatter = np.var(np.array(moved), axis=0) * (n_responses - 1)
    return np.asarray(np.sqrt(scatter))


def _narrowed(modes: Modes, lines: MeasuredLines) -> Iterator[MeasuredLines]:
    """The lines with one edge of the band moved inwards, where no mode stands in what is lost."""
    low, high = lines.frequencies[0], lines.frequencies[-1]
    step = _EDGE * (high - low)
    for inside in (lines.frequencies >= low + step, lines.frequencies <= high - step):
        if not any((half_power_lines(complex(pole), lines) & ~inside).any() for pole in modes.poles):
            yield lines.part(inside)


def _other_terms(lines: MeasuredLines) -> Iterator[MeasuredLines]:
    """The lines with the fixed poles outside the band at other places, or with more and with fewer of them."""
    for below, above in _OTHER_POLES if len(lines.outside_poles) == _ALL_POLES else _TO_FEWER:
        yield with_fixed_poles(lines, below, above)


def _scatter(modes: Modes, variants: Iterable[MeasuredLines]) -> Real:
    """Root mean square change of frequency and damping ratio with other lines, (n_modes, 2)."""
    others = [refine(modes, lines, steps=_STEPS, tolerance=_TOLERANCE).modes for lines in variants]
    if not others:
        return np.full((len(modes.poles), 2), np.nan)
    changes = [
        np.stack([other.frequencies - modes.frequencies, other.damping_ratios - modes.damping_ratios], axis=1)
        for other in others
    ]
    return np.asarray(np.sqrt(np.mean(np.square(changes), axis=0)))


def unknowns_covariance(modes: Modes, lines: MeasuredLines, found: Elimination, scale: float) -> Real:
    """Compute the covariance of the real unknowns: real parts of poles and free left entries, then imaginary parts.

    ``M^-1 (sum over lines of J^T v J) M^-1`` with v the squared error around each line, so that noise that is
    stronger at resonances widens the bars of what they decide (White, Econometrica 48, 1980).

    Parameters
    ----------
    modes, lines, found
        Modes, lines and elimination of the fit.
    scale
        Variance of a whitened complex value; half of it is in each part.
    """
    level = _smoothed(found.power(lines))
    level = level / max(float(level.mean()), 1e-300)
    normal = normal_equations(modes, lines, found)
    size = np.sqrt(np.maximum(np.diag(normal.matrix), 1e-300))
    inverse = np.linalg.pinv(normal.matrix / np.outer(size, size), hermitian=True) / np.outer(size, size)
    repeated = np.tile(np.repeat(level, lines.drive.shape[1]), 2)
    return np.asarray(0.5 * scale * inverse @ weighted_matrix(modes, lines, found, repeated) @ inverse)


def _smoothed(level: Real) -> Real:
    """Running mean over neighbouring lines."""
    reach = min(_SMOOTH, (len(level) - 1) // 2)
    padded = np.concatenate([level[reach:0:-1], level, level[-2 : -reach - 2 : -1]])
    return np.asarray(np.convolve(padded, np.ones(2 * reach + 1) / (2 * reach + 1), "valid"))
