"""Floquet multipliers of cuts, and which of many cuts are unstable."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from ..milling_loop import DelaySystem, delay_system
from .collocated_period import PeriodOperator, period_operator
from .varied_edges import varied_cut


@dataclass(frozen=True)
class Multipliers:
    """Eigenvalues of the monodromy operator, largest first.

    Parameters
    ----------
    values : (n,)
        Floquet multipliers, largest first.
    tooth_period : s
        Period of the tooth passing; of a turn where the pitch is not equal.
    """

    values: Complex
    tooth_period: float

    @property
    def spectral_radius(self) -> float:
        """Largest modulus; the cut is stable while it is below 1."""
        return float(np.abs(self.values[0]))

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle."""
        return self.spectral_radius < 1.0

    @property
    def bifurcation(self) -> str:
        """Kind of the largest: ``fold`` (positive), ``period-doubling`` (negative), ``hopf`` (a complex pair)."""
        return kind_of(complex(self.values[0]))


def kind_of(multiplier: complex) -> str:
    """Name of the loss of stability that a multiplier on or beyond the unit circle means."""
    if abs(multiplier.imag) > 1e-7 * abs(multiplier):
        return "hopf"
    return "fold" if multiplier.real > 0 else "period-doubling"


def multipliers(
    model: ModalModel, process: MillingProcess, spindle_speed: float, depth: float, *, extra_nodes: int = 0
) -> Multipliers:
    """Compute the Floquet multipliers of a cut, by collocation split at tooth entry and exit.

    The chip at the nodes is ``h = E z + a G (h - h_before)`` with h_before a tooth period ago, and the structure goes
    on by ``z_next = Phi z + a S (h - h_before)``; both together are the monodromy operator of (z, h_before)
    (Butcher et al. 2009, Stability of up- and down-milling by Chebyshev collocation).

    Parameters
    ----------
    model, process
        Modal model at the tool tip, and cut.
    spindle_speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth of cut.
    extra_nodes
        Number of nodes a piece beyond what the structure's fastest mode needs.

    Raises
    ------
    InputError
        Speed not positive, depth negative, or a structure that cannot be used.
    """
    if not (math.isfinite(spindle_speed) and spindle_speed > 0):
        raise InputError(f"spindle speed {spindle_speed!r} rad/s must be positive")
    if not (math.isfinite(depth) and depth >= 0):
        raise InputError(f"depth = {depth!r} m must be zero or more, and finite")
    if not process.is_plain:
        cut = varied_cut(delay_system(model, process), spindle_speed, depth, extra=extra_nodes)
        values = np.linalg.eigvals(cut.monodromy)
        return Multipliers(np.asarray(values[np.argsort(-np.abs(values))], dtype=complex), cut.period)
    period = 2 * np.pi / (process.teeth * spindle_speed)
    operator = period_operator(delay_system(model, process), np.array([period]), extra=extra_nodes)
    values = np.linalg.eigvals(monodromies(operator, np.zeros(1, dtype=np.int64), np.array([depth]))[0])
    return Multipliers(np.asarray(values[np.argsort(-np.abs(values))], dtype=complex), period)


def monodromies(operator: PeriodOperator, speeds: NDArray[np.int64], depths: Real) -> Real:
    """The operator of :func:`multipliers` at pairs of speed index and depth (m), shape (n_pairs, n, n)."""
    factor = depths[:, None, None]
    within, motion = factor * operator.within[speeds], operator.motion[speeds]
    nodes, size = motion.shape[1:]
    chip = np.linalg.solve(np.eye(nodes) - within, np.concatenate([motion, -within], axis=2))
    structure = np.concatenate([operator.free[speeds], np.zeros((len(depths), size, nodes))], axis=2)
    change = chip.copy()
    change[:, :, size:] -= np.eye(nodes)
    return np.concatenate([structure + factor * operator.impulse[speeds] @ change, chip], axis=1)


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
        values = scipy.sparse.linalg.eigs(
            matrix, k=6, v0=start, ncv=40, maxiter=60, tol=1e-12, return_eigenvectors=False
        )
    except scipy.sparse.linalg.ArpackError:
        values = np.linalg.eigvals(matrix)
    return bool(np.abs(values).max() >= 1)
