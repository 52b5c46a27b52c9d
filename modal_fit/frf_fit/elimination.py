"""Variable projection: given poles and left vectors, all linear unknowns are eliminated."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Band, Complex, Index, Real

from ..settings import SETTINGS
from .measured_lines import MeasuredLines


@dataclass(frozen=True)
class Modes:
    """Poles and left vectors of the modes: the unknowns that remain after the elimination."""

    poles: Complex  # (n_modes,), rad/s, in the upper half plane
    left: Complex  # (n_modes, n_excitations); the largest entry of each is 1, so that the scale is unique

    @property
    def frequencies(self) -> Real:
        """Return the natural frequencies, Hz, shape (n_modes,)."""
        return np.asarray(np.abs(self.poles) / (2 * np.pi))

    @property
    def damping_ratios(self) -> Real:
        """Return the damping ratios, shape (n_modes,)."""
        return np.asarray(-self.poles.real / np.abs(self.poles))

    @property
    def reference(self) -> Index:
        """Return the index of the excitation at which each left vector is 1, shape (n_modes,)."""
        return np.asarray(np.argmax(np.abs(self.left), axis=1), dtype=np.int64)

    def free(self) -> list[tuple[int, int]]:
        """Return (mode, excitation) of every entry of the left vectors that is unknown."""
        reference = self.reference
        return [
            (mode, column)
            for column in range(self.left.shape[1])
            for mode in range(len(self.poles))
            if column != reference[mode]
        ]

    def scaled(self) -> "Modes":
        """Return the modes with left vectors scaled so that their largest entry is 1."""
        if not len(self.poles):
            return self
        return Modes(self.poles, self.left / np.take_along_axis(self.left, self.reference[:, None], axis=1))

    def moved(self, step: Complex) -> "Modes":
        """Return the modes after adding ``step``: changes of the poles, then of the free entries of left vectors."""
        left = self.left.copy()
        for number, (mode, column) in enumerate(self.free(), start=len(self.poles)):
            left[mode, column] += step[number]
        return Modes(self.poles + step[: len(self.poles)], left)

    def chosen(self, which: NDArray[np.bool_] | slice) -> "Modes":
        """Return the modes that ``which`` selects."""
        return Modes(self.poles[which], self.left[which])

    def joined(self, other: "Modes") -> "Modes":
        """Return these modes followed by those of ``other``."""
        return Modes(np.concatenate([self.poles, other.poles]), np.concatenate([self.left, other.left]))

    def inside(self, band: Band) -> NDArray[np.bool_]:
        """Return whether each mode lies in the band."""
        return np.asarray((self.frequencies > band[0]) & (self.frequencies < band[1]))


@dataclass(frozen=True)
class Elimination:
    """Least-squares solution for all linear unknowns, with poles and left vectors given.

    Rows are the real parts of all lines and columns of the FRF, then the imaginary parts.
    """

    orthogonal: Real  # (n_rows, n_columns): factor Q of the regressors after division by scale
    triangle: Real  # (n_columns, n_columns): triangular factor R
    scale: Real  # (n_columns,): length of each regressor
    # (n_columns, n_responses), for the whitened responses: real and imaginary parts of the right vectors, then the
    # out-of-band coefficients, term by term and excitation by excitation
    solution: Real
    residual: Real  # (n_rows, n_responses), of the whitened responses
    n_modes: int

    @property
    def cost(self) -> float:
        """Return the sum of the squared residuals."""
        return float(np.vdot(self.residual, self.residual))

    @property
    def right(self) -> Complex:
        """Return the right vectors of the whitened responses, shape (n_modes, n_responses)."""
        n = self.n_modes
        return np.asarray(self.solution[:n] + 1j * self.solution[n : 2 * n])

    @property
    def out_of_band(self) -> Real:
        """Return the out-of-band coefficients of the whitened responses, (n_terms * n_excitations, n_responses)."""
        return np.asarray(self.solution[2 * self.n_modes :])

    def power(self, lines: MeasuredLines) -> Real:
        """Return the squared residual of each line, summed over columns and responses, shape (n_lines,)."""
        squared = np.sum(self.residual**2, axis=1).reshape(2, len(lines.s), -1)
        return np.asarray(squared.sum(axis=(0, 2)))

    def autocorrelation(self, lines: MeasuredLines, chosen: NDArray[np.bool_]) -> float:
        """Return the correlation of the residuals of neighbouring chosen lines: 0 for noise, near 1 for a wrong model.

        Noise of any level is independent from line to line; a missing term has the shape of a resonance.
        """
        residual = self.residual.reshape(2, len(lines.s), -1)[:, chosen]
        if residual.shape[1] < 2:
            return 1.0
        product = np.sum(residual[:, 1:] * residual[:, :-1])
        size = np.sqrt(np.sum(residual[:, 1:] ** 2) * np.sum(residual[:, :-1] ** 2))
        return float(product / size) if size > 0 else 0.0


def eliminate(modes: Modes, lines: MeasuredLines) -> Elimination:
    """Solve for the right vectors and out-of-band terms of all responses with one factorisation."""
    regressors = _stacked(_columns(modes, lines))
    scale = np.linalg.norm(regressors, axis=0)
    scale[scale == 0] = 1.0
    orthogonal, triangle = np.linalg.qr(regressors / scale)
    target = _stacked(lines.values.reshape(-1, lines.values.shape[2]))
    projected = orthogonal.T @ target
    solution = np.linalg.lstsq(triangle, projected, rcond=1e-12)[0] / scale[:, None]
    return Elimination(orthogonal, triangle, scale, solution, target - orthogonal @ projected, len(modes.poles))


def predicted(modes: Modes, elimination: Elimination, lines: MeasuredLines) -> Complex:
    """Return the whitened FRFs of the modes and out-of-band terms on any lines, (n_lines, n_columns, n_responses)."""
    return np.asarray((_columns(modes, lines) @ elimination.solution).reshape(lines.values.shape))


def _columns(modes: Modes, lines: MeasuredLines) -> Complex:
    """Return the complex regressors, shape (n_lines * n_columns, 2 n_modes + n_terms * n_excitations)."""
    direct, conjugate = _mode_functions(modes, lines)
    terms = np.einsum("nk,kjq->kjnq", lines.basis * lines.factor, lines.drive)
    pieces = [direct + conjugate, 1j * (direct - conjugate), terms.reshape(*lines.drive.shape[:2], -1)]
    columns = np.concatenate(pieces, axis=2)
    return np.asarray(columns.reshape(-1, columns.shape[2]))


def _mode_functions(modes: Modes, lines: MeasuredLines) -> tuple[Complex, Complex]:
    """Return ``s^d left^T drive / (s - p)`` of each mode and of its conjugate, (n_lines, n_columns, n_modes) each."""
    direct, conjugate = _resonances(modes.poles, lines)
    driven = np.einsum("kjq,rq->kjr", lines.drive, modes.left, optimize=True)
    driven_conjugate = np.einsum("kjq,rq->kjr", lines.drive, modes.left.conj(), optimize=True)
    return direct[:, None] * driven, conjugate[:, None] * driven_conjugate


def _resonances(poles: Complex, lines: MeasuredLines) -> tuple[Complex, Complex]:
    """Return ``s^d / (s - p)`` of each pole p, and of its conjugate, (n_lines, n_modes) each."""
    s, factor = lines.s[:, None], lines.factor[:, None]
    return factor / (s - poles), factor / (s - poles.conj())


def derivatives(modes: Modes, lines: MeasuredLines) -> tuple[Real, Index]:
    """Return the functions from which derivatives by poles and left vectors are built, and the mode of each function.

    The contribution of a mode with the right vector entry a + ib has the derivatives ``a u + b v`` by the real part of
    an unknown and ``a v - b u`` by its imaginary part; u and v are the same for all responses. The functions are
    (n_rows, 2 n_unknowns): first all u, then all v.
    """
    direct, conjugate = _resonances(modes.poles, lines)
    by_pole, by_conjugate = _mode_functions(modes, lines)
    by_pole = by_pole / (lines.s[:, None] - modes.poles)[:, None]
    by_conjugate = by_conjugate / (lines.s[:, None] - modes.poles.conj())[:, None]
    owners = list(range(len(modes.poles)))
    first, second = [by_pole], [by_conjugate]
    free = modes.free()
    if free:
        mode, column = (np.array(indices) for indices in zip(*free, strict=True))
        first.append(direct[:, None, mode] * lines.drive[:, :, column])
        second.append(conjugate[:, None, mode] * lines.drive[:, :, column])
        owners += mode.tolist()
    plus, minus = np.concatenate(first, axis=2), np.concatenate(second, axis=2)
    functions = np.concatenate([plus + minus, 1j * (plus - minus)], axis=2)
    return _stacked(functions.reshape(-1, functions.shape[2])), np.array(owners, dtype=np.int64)


def _stacked(columns: Complex) -> Real:
    """Stack the real parts above the imaginary parts."""
    return np.concatenate([columns.real, columns.imag])


def just_outside(pole: complex, band: Band) -> bool:
    """Return whether a pole (rad/s) outside the band may be a mode whose flank reaches into the band.

    The fixed out-of-band poles cannot represent such a mode: the fit would move a mode from inside the band there.

    >>> [just_outside(2 * np.pi * f * (-0.01 + 1j), (20.0, 40.0)) for f in (10, 18, 30, 45, 80)]
    [False, True, False, True, False]
    """
    frequency, damping = abs(pole) / (2 * np.pi), -pole.real / abs(pole)
    low, high = band
    reach = SETTINGS.outer_mode_reach
    near = low / reach < frequency <= low or high <= frequency < high * reach
    return bool(near and 0 < damping < SETTINGS.largest_damping)


def without_modes(lines: MeasuredLines, modes: Modes, right: Complex) -> MeasuredLines:
    """Subtract the contribution of modes from the lines; ``right`` (n_modes, n_responses) is whitened."""
    if not len(modes.poles):
        return lines
    direct, conjugate = _mode_functions(modes, lines)
    contribution = np.einsum("kjr,rp->kjp", direct, right, optimize=True)
    contribution += np.einsum("kjr,rp->kjp", conjugate, right.conj(), optimize=True)
    return replace(lines, values=lines.values - contribution)


def mode_power(modes: Modes, right: Complex, lines: MeasuredLines) -> Real:
    """Return the power that each mode alone has on each line, shape (n_lines, n_modes).

    Unlike the modes at an antiresonance, their powers do not cancel. The sum of the powers therefore bounds the
    residual that errors of the modes can cause on a line.
    """
    direct, _ = _mode_functions(modes, lines)
    return np.asarray(np.sum(np.abs(direct) ** 2, axis=1) * np.sum(np.abs(right) ** 2, axis=1))


def out_of_band_power(elimination: Elimination, lines: MeasuredLines) -> Real:
    """Return the power of the out-of-band terms on each line, shape (n_lines,)."""
    coefficients = elimination.out_of_band.reshape(len(lines.basis), lines.drive.shape[2], -1)
    terms = np.einsum("nk,nqp->kqp", lines.basis * lines.factor, coefficients, optimize=True)
    driven = np.einsum("kjq,kqp->kjp", lines.drive, terms, optimize=True)
    return np.asarray(np.sum(np.abs(driven) ** 2, axis=(1, 2)))


def participation(pole: complex, lines: MeasuredLines, elimination: Elimination) -> Complex:
    """Return the left vector of a new pole (rad/s), shape (1, n_excitations).

    It is the leading left singular vector of the residue matrix that is fitted to the residual.

    ``elimination`` is the fit without the pole. Its regressors are projected out, so that the new pole only explains
    what they cannot.
    """
    n_excitations = lines.drive.shape[2]
    direct = (lines.factor / (lines.s - pole))[:, None, None] * lines.drive
    conjugate = (lines.factor / (lines.s - np.conj(pole)))[:, None, None] * lines.drive
    columns = np.concatenate([direct + conjugate, 1j * (direct - conjugate)], axis=2).reshape(-1, 2 * n_excitations)
    real = _stacked(columns)
    real -= elimination.orthogonal @ (elimination.orthogonal.T @ real)
    solution = np.linalg.lstsq(real, elimination.residual, rcond=1e-10)[0]
    residue = solution[:n_excitations] + 1j * solution[n_excitations:]  # residue[q, p] = left[q] right[p]
    return np.asarray(np.linalg.svd(residue)[0][:, 0][None, :])


def participations(poles: Complex, lines: MeasuredLines) -> Complex:
    """Return the left vectors of many poles from full residue matrices, shape (n_modes, n_excitations).

    Each entry of the FRF matrix has the same regressors, so that all share one factorisation.
    """
    n_modes, n_excitations = len(poles), lines.drive.shape[2]
    weights = np.sqrt(np.mean(lines.weights**2, axis=1))
    matrix = np.linalg.solve(lines.drive, lines.values)
    direct, conjugate = _resonances(poles, lines)
    terms = (lines.basis * lines.factor).T
    columns = np.concatenate([direct + conjugate, 1j * (direct - conjugate), terms], axis=1) * weights[:, None]
    target = (matrix * weights[:, None, None]).reshape(len(weights), -1)
    real = _stacked(columns)
    scale = np.linalg.norm(real, axis=0)
    solution = np.linalg.lstsq(real / scale, _stacked(target), rcond=1e-12)[0] / scale[:, None]
    residues = (solution[:n_modes] + 1j * solution[n_modes : 2 * n_modes]).reshape(n_modes, n_excitations, -1)
    return np.asarray(np.linalg.svd(residues, full_matrices=False)[0][:, :, 0])
