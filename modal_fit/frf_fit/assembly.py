"""The step from whitened modes back to a `ModalModel`, with the covariance of poles and vectors."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimation import Frf, FrfCovariance

from ..models import ModalModel, ModeErrors, residuals_with_poles
from .variable_projection import Elimination, MeasuredLines, Modes, Real, derivatives

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
