"""Largest Floquet multiplier of a collocated cut by Arnoldi's method: no monodromy matrix is formed."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import scipy

from millfrf.core import Complex, InputError, Real
from millfrf.core.compilation import compiled

from .cut_period import CollocatedCut
from .period_map import CutPeriod, next_period, period_example

MOST_VECTORS = 124  # of the Krylov space, before Arnoldi's method is restarted
CONVERGED = 1e-9  # residual of the largest multiplier; rounding leaves 1e-12


@dataclass(frozen=True)
class LeadingMultipliers:
    """Largest Floquet multipliers of a cut, largest first, and their motions."""

    values: Complex  # (n,)
    basis: Real  # (size, n_vectors): of the motions
    shares: Complex  # (n_vectors, n)

    @property
    def vectors(self) -> Complex:
        """Return state at the beginning of a period, and motion at the nodes of the period before, (size, n)."""
        return np.asarray(self.basis @ self.shares)

    @property
    def radius(self) -> float:
        """Return the modulus of the largest multiplier; the cut is stable if it is below 1."""
        return float(abs(self.values[0]))


def leading_multipliers(cut: CollocatedCut, floor: float = np.inf, tolerance: float = CONVERGED) -> LeadingMultipliers:
    """Compute the largest Floquet multiplier of a cut, and all others above ``floor``.

    The Krylov space grows until the residuals of these multipliers are below ``tolerance``. Where it would need more
    than 124 vectors, Arnoldi's method is restarted (ARPACK).

    Raises
    ------
    InputError
        The eigenvalues do not converge.
    """
    period = cut.period
    size = period.size
    most = min(MOST_VECTORS, size)
    basis, hessenberg = np.empty((most + 1, size)), np.zeros((most + 1, most))
    basis[0] = _start(size)
    begin = 0
    for step in _vector_counts(period.matrices.gaps.shape[1], most):
        end = _extend(period, basis, hessenberg, begin, step)
        values, vectors = _eigenvectors(hessenberg[:end, :end])
        sizes = np.abs(values)
        wanted = np.argsort(-sizes)[: max(1, int(np.count_nonzero(sizes > floor)))]
        residuals = abs(hessenberg[end, end - 1]) * np.abs(vectors[-1, wanted])
        if np.all(residuals < tolerance * np.maximum(1.0, sizes[wanted])) or end < step or end == size:
            return LeadingMultipliers(values[wanted], basis[:end].T, vectors[:, wanted])
        begin = end
    return _restarted(period, size, floor)


def _vector_counts(modes: int, most: int) -> Iterator[int]:
    """Yield the numbers of vectors after which convergence is checked: each check costs as much as some vectors.

    The state of each mode takes two vectors, and the motion at the nodes about one more.
    """
    count = 3 * modes + 2
    while count < most:
        yield count
        count = math.ceil(1.5 * count)
    yield most


def _eigenvectors(matrix: Real) -> tuple[Complex, Complex]:
    """Return eigenvalues and eigenvectors as ``numpy.linalg.eig`` does, which takes twice the time for small matrices.

    Raises
    ------
    numpy.linalg.LinAlgError
        They do not converge, or the matrix is not finite.
    """
    if not math.isfinite(matrix.sum()):
        raise np.linalg.LinAlgError("the map of a period is not finite")
    real, imaginary, _, columns, failed = scipy.linalg.lapack.dgeev(matrix, compute_vl=0)
    if failed:
        raise np.linalg.LinAlgError("eigenvalues did not converge")
    vectors = columns.astype(complex)
    for k in np.flatnonzero(imaginary > 0):  # the real and the imaginary part of a pair follow each other
        vectors[:, k] += 1j * columns[:, k + 1]
        vectors[:, k + 1] = vectors[:, k].conj()
    return real + 1j * imaginary, vectors


@cache
def _start(size: int) -> Real:
    start = np.cos(np.arange(size) ** 1.3)  # fixed, so that results repeat
    return np.asarray(start / np.linalg.norm(start))


def _restarted(period: CutPeriod, size: int, floor: float) -> LeadingMultipliers:
    operator = scipy.sparse.linalg.LinearOperator(
        (size, size), matvec=lambda vector: next_period(period, vector.ravel())[0], dtype=float
    )
    for count in (6, 24, 96):
        try:
            values, vectors = scipy.sparse.linalg.eigs(
                operator, k=min(count, size - 2), v0=_start(size), ncv=min(3 * count + 40, size), maxiter=100, tol=1e-10
            )
        except scipy.sparse.linalg.ArpackError as error:
            raise InputError(
                f"the Floquet multipliers do not converge ({error}); leave out the highest modes"
            ) from error
        order = np.argsort(-np.abs(values))
        if not abs(values[order[-1]]) > floor:
            break
    wanted = order[: max(1, int((np.abs(values) > floor).sum()))]
    return LeadingMultipliers(values[wanted], vectors[:, wanted], np.eye(len(wanted), dtype=complex))


def _arnoldi_example() -> tuple[Any, ...]:
    return period_example()[0], np.zeros((1, 1)), np.zeros((1, 1)), 0, 0


@compiled(example=_arnoldi_example)
def _extend(cut: CutPeriod, basis: Real, hessenberg: Real, begin: int, end: int) -> int:
    """Extend an orthonormal basis of the Krylov space from ``begin`` to ``end`` vectors; return how many there are."""
    for k in range(begin, end):
        vector, _ = next_period(cut, basis[k])
        size = np.linalg.norm(vector)
        for _ in range(2):  # twice is enough
            shares = basis[: k + 1] @ vector
            vector -= shares @ basis[: k + 1]
            hessenberg[: k + 1, k] += shares
        length = np.linalg.norm(vector)
        if length <= 1e-14 * size:
            hessenberg[k + 1, k] = 0.0
            return k + 1
        hessenberg[k + 1, k] = length
        basis[k + 1] = vector / length
    return end


def monodromy(cut: CollocatedCut) -> Real:
    """Compute the matrix that maps state and motion at the nodes from one period to the next."""
    return np.column_stack([next_period(cut.period, unit)[0] for unit in np.eye(cut.period.size)])


def force_at_nodes(cut: CollocatedCut, vector: Complex) -> Complex:
    """Return the force (n_nodes, n_directions), N, that a motion of one period causes in the next."""
    real, imaginary = (next_period(cut.period, np.ascontiguousarray(part))[1] for part in (vector.real, vector.imag))
    return np.asarray(real + 1j * imaginary)
