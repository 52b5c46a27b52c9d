"""Variable projection: given poles and left vectors, all that belongs to one response is linear and eliminated."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .whitened_lines import MeasuredLines

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


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
