"""Variable projection: given poles and left vectors, all linear unknowns are eliminated."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, Real

from ..models.modal_model import ModalModel
from ..models.out_of_band import Residuals
from .measured_lines import MeasuredLines


@dataclass(frozen=True)
class Modes:
    """The unknowns that remain after the elimination: poles and left vectors.

    Parameters
    ----------
    poles : (n_modes,), rad/s
        Poles in the upper half plane.
    left : (n_modes, n_excitations)
        Left vectors. The largest entry of each is 1, so that the pair of vectors has one scale.
    """

    poles: Complex
    left: Complex

    @staticmethod
    def none(n_excitations: int) -> "Modes":
        """Give an empty set of modes."""
        return Modes(np.zeros(0, dtype=complex), np.zeros((0, n_excitations), dtype=complex))

    @property
    def frequencies(self) -> Real:
        """Natural frequencies, Hz, shape (n_modes,)."""
        return np.asarray(np.abs(self.poles) / (2 * np.pi))

    @property
    def damping_ratios(self) -> Real:
        """Damping ratios, shape (n_modes,)."""
        return np.asarray(-self.poles.real / np.abs(self.poles))

    @property
    def reference(self) -> NDArray[np.int64]:
        """Excitation at which each left vector is 1, shape (n_modes,)."""
        return np.asarray(np.argmax(np.abs(self.left), axis=1), dtype=np.int64)

    def free(self) -> list[tuple[int, int]]:
        """(mode, excitation) of the entries of the left vectors that are unknown."""
        reference = self.reference
        return [
            (mode, column)
            for column in range(self.left.shape[1])
            for mode in range(len(self.poles))
            if column != reference[mode]
        ]

    def scaled(self) -> "Modes":
        """The same modes with left vectors of which the largest entry is 1."""
        if not len(self.poles):
            return self
        return Modes(self.poles, self.left / np.take_along_axis(self.left, self.reference[:, None], axis=1))

    def moved(self, step: Complex) -> "Modes":
        """Add a step of the poles and of the free entries of the left vectors."""
        left = self.left.copy()
        for number, (mode, column) in enumerate(self.free(), start=len(self.poles)):
            left[mode, column] += step[number]
        return Modes(self.poles + step[: len(self.poles)], left)

    def chosen(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> "Modes":
        """Some of the modes."""
        return Modes(self.poles[which], self.left[which])

    def joined(self, other: "Modes") -> "Modes":
        """These modes and then those of ``other``."""
        return Modes(np.concatenate([self.poles, other.poles]), np.concatenate([self.left, other.left]))


@dataclass(frozen=True)
class Elimination:
    """Least-squares solution of everything that is linear, with poles and left vectors given.

    Parameters
    ----------
    orthogonal, triangle : (n_rows, n_columns), (n_columns, n_columns)
        QR factors of the regressors, whose columns were divided by ``scale``. Rows are the real parts of all lines and
        columns of the FRF, then the imaginary parts.
    scale : (n_columns,)
        Norm by which each column of the regressors was divided.
    solution : (n_columns, n_responses)
        Real and imaginary parts of the right vectors, then the out-of-band coefficients (term by term, excitation by
        excitation), of the whitened responses.
    error : (n_rows, n_responses)
        Residual of the whitened responses.
    n_modes
        Number of modes that were eliminated.
    """

    orthogonal: Real
    triangle: Real
    scale: Real
    solution: Real
    error: Real
    n_modes: int

    @property
    def cost(self) -> float:
        """Sum of the squared errors."""
        return float(np.vdot(self.error, self.error))

    @property
    def right(self) -> Complex:
        """Right vectors of the whitened responses, shape (n_modes, n_responses)."""
        n = self.n_modes
        return np.asarray(self.solution[:n] + 1j * self.solution[n : 2 * n])

    @property
    def outside(self) -> Real:
        """Out-of-band coefficients of the whitened responses, (n_terms * n_excitations, n_responses)."""
        return np.asarray(self.solution[2 * self.n_modes :])

    def power(self, lines: MeasuredLines) -> Real:
        """Squared error of each line, summed over columns and responses, shape (n_lines,)."""
        squared = np.sum(self.error**2, axis=1).reshape(2, len(lines.s), -1)
        return np.asarray(squared.sum(axis=(0, 2)))

    def colour(self, lines: MeasuredLines, chosen: NDArray[np.bool_]) -> float:
        """Correlation of the errors of neighbouring lines among the chosen: 0 for noise, near 1 for a wrong model.

        Noise of whatever level has no memory from line to line; what a model misses has the shape of resonances.
        """
        n_lines = len(lines.s)
        error = self.error.reshape(2, n_lines, -1)[:, chosen]
        if error.shape[1] < 2:
            return 1.0
        near = np.sum(error[:, 1:] * error[:, :-1])
        size = np.sqrt(np.sum(error[:, 1:] ** 2) * np.sum(error[:, :-1] ** 2))
        return float(near / size) if size > 0 else 0.0


def eliminate(modes: Modes, lines: MeasuredLines) -> Elimination:
    """Solve for right vectors and out-of-band terms of all responses with one factorisation."""
    regressors = _stacked(_columns(modes, lines))
    scale = np.linalg.norm(regressors, axis=0)
    scale[scale == 0] = 1.0
    orthogonal, triangle = np.linalg.qr(regressors / scale)
    target = _stacked(lines.values.reshape(-1, lines.values.shape[2]))
    projected = orthogonal.T @ target
    solution = np.linalg.lstsq(triangle, projected, rcond=1e-12)[0] / scale[:, None]
    return Elimination(orthogonal, triangle, scale, solution, target - orthogonal @ projected, len(modes.poles))


def predicted(modes: Modes, found: Elimination, lines: MeasuredLines) -> Complex:
    """Whitened FRFs that modes and their linear part give on any lines, (n_lines, n_columns, n_responses)."""
    return np.asarray((_columns(modes, lines) @ found.solution).reshape(lines.values.shape))


def _columns(modes: Modes, lines: MeasuredLines) -> Complex:
    """Regressors, complex, shape (n_lines * n_columns, 2 n_modes + n_terms * n_excitations)."""
    direct, mirror = shaped(modes, lines)
    pieces = [direct + mirror, 1j * (direct - mirror)]
    outside = np.einsum("nk,kjq->kjnq", lines.basis * lines.factor, lines.drive)
    pieces.append(outside.reshape(*lines.drive.shape[:2], -1))
    stacked = np.concatenate(pieces, axis=2)
    return np.asarray(stacked.reshape(-1, stacked.shape[2]))


def shaped(modes: Modes, lines: MeasuredLines) -> tuple[Complex, Complex]:
    """Each mode's ``s^d left^T drive / (s - p)`` and the conjugate pole's, (n_lines, n_columns, n_modes) each."""
    direct, mirror = _resonances(modes, lines)
    driven = np.einsum("kjq,rq->kjr", lines.drive, modes.left, optimize=True)
    conjugate = np.einsum("kjq,rq->kjr", lines.drive, modes.left.conj(), optimize=True)
    return direct[:, None] * driven, mirror[:, None] * conjugate


def _resonances(modes: Modes, lines: MeasuredLines) -> tuple[Complex, Complex]:
    s, factor = lines.s[:, None], lines.factor[:, None]
    return factor / (s - modes.poles), factor / (s - modes.poles.conj())


def derivatives(modes: Modes, lines: MeasuredLines) -> tuple[Real, NDArray[np.int64]]:
    """Functions of which the derivatives by poles and left vectors are made, and the mode that each belongs to.

    A right vector's entry a + ib has the derivatives ``a u + b v`` by a real part and ``a v - b u`` by an imaginary
    part, with u and v the same for all responses: the first half of the columns is u, the second v.

    Returns
    -------
    (n_rows, 2 n_unknowns) and (n_unknowns,)
    """
    direct, mirror = _resonances(modes, lines)
    by_pole, by_conjugate = shaped(modes, lines)
    by_pole = by_pole / (lines.s[:, None] - modes.poles)[:, None]
    by_conjugate = by_conjugate / (lines.s[:, None] - modes.poles.conj())[:, None]
    owners = list(range(len(modes.poles)))
    first, second = [by_pole], [by_conjugate]
    free = modes.free()
    if free:
        mode, column = (np.array(part) for part in zip(*free, strict=True))
        first.append(direct[:, None, mode] * lines.drive[:, :, column])
        second.append(mirror[:, None, mode] * lines.drive[:, :, column])
        owners += mode.tolist()
    plus, minus = np.concatenate(first, axis=2), np.concatenate(second, axis=2)
    both = np.concatenate([plus + minus, 1j * (plus - minus)], axis=2)
    return _stacked(both.reshape(-1, both.shape[2])), np.array(owners, dtype=np.int64)


def _stacked(columns: Complex) -> Real:
    """Real parts above imaginary parts."""
    return np.concatenate([columns.real, columns.imag])


REACH = 1.5
"""A pole within this factor of an edge of the band may be a mode whose flank reaches into the band."""

_NO_VIBRATION = 0.5  # damping ratio


def inside(modes: Modes, band: tuple[float, float]) -> NDArray[np.bool_]:
    """Say which modes stand in the band."""
    return np.asarray((modes.frequencies > band[0]) & (modes.frequencies < band[1]))


def just_outside(pole: complex, band: tuple[float, float]) -> bool:
    """Whether a pole (rad/s) outside the band may be a mode whose flank reaches into it.

    A mode there cannot be left to the fixed out-of-band poles: a mode inside would leave its place for it.

    Examples
    --------
    >>> [just_outside(2 * np.pi * f * (-0.01 + 1j), (20.0, 40.0)) for f in (10, 18, 30, 45, 80)]
    [False, True, False, True, False]
    """
    frequency, damping = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
    low, high = band
    near = low / REACH < frequency <= low or high <= frequency < high * REACH
    return bool(near and 0 < damping < _NO_VIBRATION)


def with_outer_as_residuals(model: ModalModel) -> ModalModel:
    """Move the modes outside the band of a model to its residuals.

    Parameters
    ----------
    model
        Modal model with a band, and with covariance and errors of all modes.
    """
    assert model.band is not None
    frequencies = model.natural_frequencies
    stays = (frequencies > model.band[0]) & (frequencies < model.band[1])
    if stays.all():
        return model
    outer = ~stays
    residues = np.einsum("rp,rq->rpq", model.right[outer], model.left[outer])
    return replace(
        model,
        poles=model.poles[stays],
        right=model.right[stays],
        left=model.left[stays],
        residuals=_joined(model.residuals, model.poles[outer], residues),
        covariance=None if model.covariance is None else _part(model, stays),
        errors=None if model.errors is None else model.errors.ordered(np.flatnonzero(stays)),
    )


def _joined(residuals: Residuals | None, poles: NDArray[np.complex128], residues: NDArray[np.complex128]) -> Residuals:
    """Residuals with further poles."""
    if residuals is None:
        nothing = np.zeros(residues.shape[1:])
        return Residuals(nothing, nothing, poles, residues)
    if residuals.poles is None or residuals.residues is None:
        return replace(residuals, poles=poles, residues=residues)
    return replace(
        residuals,
        poles=np.concatenate([residuals.poles, poles]),
        residues=np.concatenate([residuals.residues, residues]),
    )


def _part(model: ModalModel, stays: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Rows and columns of the covariance that belong to the modes that stay."""
    assert model.covariance is not None
    widths = (1, 1, model.right.shape[1], model.right.shape[1], model.left.shape[1], model.left.shape[1])
    kept = np.concatenate([np.repeat(stays, width) for width in widths])
    return np.asarray(model.covariance[np.ix_(kept, kept)])


_WIDTH = 6.0  # half widths of the pole's half-power band
_FEWEST = 24  # lines
_LINES_PER_TERM = 6


def around(frequency: float, damping_ratio: float, lines: MeasuredLines) -> NDArray[np.bool_]:
    """Lines around a pole: six half-power bands to each side, at least as many as the unknowns need."""
    axis = lines.frequencies
    half = max(_WIDTH * damping_ratio * frequency, 0.5 * _FEWEST * lines.spacing)
    wanted = min(len(axis), max(_FEWEST, _LINES_PER_TERM * len(lines.basis)))
    chosen = np.abs(axis - frequency) <= half
    while chosen.sum() < wanted:
        half *= 1.3
        chosen = np.abs(axis - frequency) <= half
    return np.asarray(chosen)


def half_power_lines(pole: complex, lines: MeasuredLines) -> NDArray[np.bool_]:
    """Lines inside a pole's half-power band, at least five where the grid has them."""
    frequency, damping_ratio = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
    half = max(damping_ratio * frequency, 2.5 * lines.spacing)
    return np.asarray(np.abs(lines.frequencies - frequency) <= half)


def without_modes(lines: MeasuredLines, modes: Modes, right: Complex) -> MeasuredLines:
    """The lines with some modes' contribution taken away; ``right`` (n_modes, n_responses) is whitened."""
    if not len(modes.poles):
        return lines
    direct, mirror = shaped(modes, lines)
    contribution = np.einsum("kjr,rp->kjp", direct, right, optimize=True)
    contribution += np.einsum("kjr,rp->kjp", mirror, right.conj(), optimize=True)
    return replace(lines, values=lines.values - contribution)


def mode_power(modes: Modes, right: Complex, lines: MeasuredLines) -> Real:
    """Power of each mode's own contribution on each line, shape (n_lines, n_modes).

    Powers of modes do not cancel as the modes themselves do at an antiresonance, so that their sum is the measure of
    what an error of the modes can leave on a line.
    """
    direct, _ = shaped(modes, lines)
    return np.asarray(np.sum(np.abs(direct) ** 2, axis=1) * np.sum(np.abs(right) ** 2, axis=1))


def outside_power(found: Elimination, lines: MeasuredLines) -> Real:
    """Power of the out-of-band terms on each line, shape (n_lines,)."""
    n_terms, n_excitations = len(lines.basis), lines.drive.shape[2]
    coefficients = found.outside.reshape(n_terms, n_excitations, -1)
    terms = np.einsum("nk,nqp->kqp", lines.basis * lines.factor, coefficients, optimize=True)
    driven = np.einsum("kjq,kqp->kjp", lines.drive, terms, optimize=True)
    return np.asarray(np.sum(np.abs(driven) ** 2, axis=(1, 2)))


def participation(pole: complex, lines: MeasuredLines, found: Elimination) -> Complex:
    """Give the left vector of a new pole: the leading one of the residue matrix that the residual asks for.

    Parameters
    ----------
    pole : rad/s
        The new pole, in the upper half plane.
    lines
        Lines on which the residue matrix is fitted.
    found
        Fit without the pole; the part of the lines that it can explain is projected out.

    Returns
    -------
    (1, n_excitations)
    """
    n_excitations = lines.drive.shape[2]
    direct = (lines.factor / (lines.s - pole))[:, None, None] * lines.drive
    mirror = (lines.factor / (lines.s - np.conj(pole)))[:, None, None] * lines.drive
    columns = np.concatenate([direct + mirror, 1j * (direct - mirror)], axis=2).reshape(-1, 2 * n_excitations)
    real = np.concatenate([columns.real, columns.imag])
    real -= found.orthogonal @ (found.orthogonal.T @ real)
    solved = np.linalg.lstsq(real, found.error, rcond=1e-10)[0]
    residue = solved[:n_excitations] + 1j * solved[n_excitations:]
    # residue[q, p] = left[q] right[p]
    return np.asarray(np.linalg.svd(residue)[0][:, 0][None, :])


def participations(poles: Complex, lines: MeasuredLines) -> Complex:
    """Left vectors of many poles at once, from full residue matrices, shape (n_modes, n_excitations).

    Each entry of the FRF matrix has the same regressors, so that one factorisation serves all.
    """
    n_modes, (_, n_columns, n_excitations) = len(poles), lines.drive.shape
    weights = np.sqrt(np.mean(lines.weights**2, axis=1))
    if n_columns == n_excitations:
        matrix = np.linalg.solve(lines.drive, lines.values)
    else:
        matrix = np.linalg.pinv(lines.drive) @ lines.values
    direct = lines.factor[:, None] / (lines.s[:, None] - poles)
    mirror = lines.factor[:, None] / (lines.s[:, None] - poles.conj())
    outside = (lines.basis * lines.factor).T
    columns = np.concatenate([direct + mirror, 1j * (direct - mirror), outside], axis=1) * weights[:, None]
    target = (matrix * weights[:, None, None]).reshape(len(weights), -1)
    real = np.concatenate([columns.real, columns.imag])
    scale = np.linalg.norm(real, axis=0)
    solved = np.linalg.lstsq(real / scale, np.concatenate([target.real, target.imag]), rcond=1e-12)[0] / scale[:, None]
    residues = (solved[:n_modes] + 1j * solved[n_modes : 2 * n_modes]).reshape(n_modes, n_excitations, -1)
    return np.asarray(np.linalg.svd(residues, full_matrices=False)[0][:, :, 0])
