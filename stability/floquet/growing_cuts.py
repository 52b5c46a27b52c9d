"""Unstable cuts among many: powers of their monodromy matrices, eigenvalues only where these do not tell."""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.linalg import ArpackError, eigs

from ..milling_loop import DelaySystem
from .collocated_period import period_operator
from .floquet_multipliers import monodromies
from .varied_edges import varied_cut

Real = NDArray[np.float64]

SQUARINGS = 22
"""How often a matrix is squared before its eigenvalues are taken."""

LARGE = 120
"""Matrices with more rows have their largest eigenvalues looked for by Arnoldi's method first."""

BATCH = 4_000_000
"""Entries of matrices that are held in memory together."""


def unstable_cuts(system: DelaySystem, speeds: Real, depths: Real, *, extra: int = 0) -> NDArray[np.bool_]:
    """Decide whether a Floquet multiplier lies on or beyond the unit circle, at pairs of speed and depth.

    Parameters
    ----------
    system
        Structure and process.
    speeds, depths : (n_pairs,)
        Spindle speed (rad/s) and axial depth (m) of each cut.
    extra
        Number of nodes a piece beyond what the structure's fastest mode needs.

    Raises
    ------
    InputError
        The structure turns so often in a period that too many nodes would be needed.
    """
    result = np.zeros(len(speeds), dtype=bool)
    if not system.process.is_plain:
        for pair, (speed, depth) in enumerate(zip(speeds, depths, strict=True)):
            monodromy = varied_cut(system, float(speed), float(depth), extra=extra).monodromy
            result[pair] = growing(monodromy[None])[0]
        return result
    for chunk in _chunks(speeds):
        different, place = np.unique(speeds[chunk], return_inverse=True)
        operator = period_operator(system, 2 * np.pi / (system.process.teeth * different), extra=extra)
        size = operator.within.shape[1] + operator.free.shape[1]
        for part in np.array_split(np.arange(len(chunk)), int(np.ceil(len(chunk) * size**2 / BATCH))):
            result[chunk[part]] = growing(monodromies(operator, place[part], depths[chunk[part]]))
    return result


def _chunks(speeds: Real) -> list[NDArray[np.int64]]:
    """Indices of pairs whose speeds differ by less than a seventh: they share nodes."""
    group = np.floor(np.log(speeds / speeds.min()) / np.log(1.15)).astype(int)
    order = np.argsort(group, kind="stable")
    return np.split(order, np.flatnonzero(np.diff(group[order])) + 1) if len(speeds) else []


def growing(matrices: Real) -> NDArray[np.bool_]:
    """Whether each matrix (n, k, k) has an eigenvalue on or beyond the unit circle.

    ``|U^N| < 1`` proves that there is none; ``|U^N| > 1e12`` is taken as a proof that there is one, since no transient
    of a cut grows that far.

    Examples
    --------
    >>> growing(np.array([[[0.9, 5.0], [0.0, 0.8]], [[1.001, 0.0], [0.0, 0.2]]])).tolist()
    [False, True]
    """
    result = np.zeros(len(matrices), dtype=bool)
    if matrices.shape[1] > LARGE:
        return np.array([_grows(matrix) for matrix in matrices], dtype=bool)
    live, power = np.arange(len(matrices)), matrices
    for _ in range(SQUARINGS):
        size = np.sqrt(np.einsum("nij,nij->n", power, power))
        result[live[size > 1e12]] = True
        open_ = (size >= 1) & (size <= 1e12)
        live, power = live[open_], power[open_]
        if not len(live):
            return result
        power = power @ power
    for k in live:
        result[k] = np.abs(np.linalg.eigvals(matrices[k])).max() >= 1
    return result


def _grows(matrix: Real) -> bool:
    """Whether one large matrix has an eigenvalue on or beyond the unit circle."""
    start = np.cos(np.arange(len(matrix)) ** 1.3)
    try:
        values = eigs(matrix, k=6, v0=start, ncv=40, maxiter=60, tol=1e-12, return_eigenvectors=False)
    except ArpackError:
        values = np.linalg.eigvals(matrix)
    return bool(np.abs(values).max() >= 1)
