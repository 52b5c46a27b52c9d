"""Floquet multipliers of cuts, and which of many cuts are unstable."""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import Complex, Index, InputError, Real
from millfrf.cutting import MillingProcess
from modal_fit import ModalModel

from ..milling_loop import DelaySystem, delay_system, speed_groups
from .collocated_period import PeriodOperator, largest_first, period_operator
from .cut_period import collocated_cut
from .growth import leading_multipliers, monodromy
from .turning_loop import unstable_turning


@dataclass(frozen=True)
class Multipliers:
    """Eigenvalues of the monodromy operator."""

    values: Complex  # (n,), largest first
    tooth_period: float  # s; with unequal pitch, the time of a revolution

    @property
    def spectral_radius(self) -> float:
        """Return the largest modulus of the multipliers; the cut is stable if it is below 1."""
        return float(np.abs(self.values[0]))

    @property
    def stable(self) -> bool:
        """Check whether all multipliers lie inside the unit circle."""
        return self.spectral_radius < 1.0

    @property
    def bifurcation(self) -> str:
        """Name the kind of the largest multiplier: ``fold`` (positive), ``period-doubling`` (negative), ``hopf``."""
        return kind_of(complex(self.values[0]), 1e-7 * self.spectral_radius)


def kind_of(multiplier: complex, tolerance: float = 1e-6) -> str:
    """Name the bifurcation that a multiplier on or beyond the unit circle causes.

    A multiplier counts as real if its imaginary part is below the tolerance.
    """
    if abs(multiplier.imag) > tolerance:
        return "hopf"
    return "fold" if multiplier.real > 0 else "period-doubling"


def check_cut(spindle_speed: float, depth: float) -> None:
    """Refuse a spindle speed (rad/s) that is not positive or a depth (m) that is negative."""
    if not (math.isfinite(spindle_speed) and spindle_speed > 0):
        raise InputError(f"spindle speed {spindle_speed!r} rad/s must be positive")
    if not (math.isfinite(depth) and depth >= 0):
        raise InputError(f"depth = {depth!r} m must be zero or more, and finite")


def multipliers(
    model: ModalModel, process: MillingProcess, spindle_speed: float, depth: float, *, extra_nodes: int = 0
) -> Multipliers:
    """Compute the Floquet multipliers of a cut, by collocation split at tooth entry and exit.

    The motion along the chip at the nodes is ``h = E z + a G (h - h_before)``, with h_before one tooth period earlier,
    and the state after the period is ``z_next = Phi z + a S (h - h_before)``. Both equations together are the monodromy
    operator of (z, h_before) (Butcher et al. 2009, Stability of up- and down-milling by Chebyshev collocation).

    Parameters
    ----------
    model, process
        Modal model at the tool tip, and cut.
    spindle_speed : rad/s
        Spindle speed of the cut.
    depth : m
        Axial depth of cut.
    extra_nodes
        Number of nodes in each piece beyond what the structure's fastest mode needs.

    Raises
    ------
    InputError
        Speed not positive, depth negative, or a structure that cannot be used.
    """
    check_cut(spindle_speed, depth)
    system = delay_system(model, process)
    if not process.is_plain:
        cut = collocated_cut(system, spindle_speed, depth, extra=extra_nodes)
        return sorted_multipliers(monodromy(cut), cut.duration)
    period = 2 * np.pi / (process.teeth * spindle_speed)
    operator = period_operator(system, np.array([period]), extra=extra_nodes)
    return sorted_multipliers(monodromies(operator, np.zeros(1, dtype=np.int64), np.array([depth]))[0], period)


def sorted_multipliers(monodromy: Real, period: float) -> Multipliers:
    """Compute the eigenvalues of a monodromy matrix (n, n) over a period (s), largest first."""
    return Multipliers(largest_first(np.linalg.eigvals(monodromy).astype(complex)[None])[0], period)


def monodromies(operator: PeriodOperator, speeds: Index, depths: Real) -> Real:
    """Compute the monodromy matrices at pairs of speed index and depth (m), shape (n_pairs, n, n)."""
    factor = depths[:, None, None]
    within, motion = factor * operator.within[speeds], operator.motion[speeds]
    nodes, size = motion.shape[1:]
    chip = np.linalg.solve(np.eye(nodes) - within, np.concatenate([motion, -within], axis=2))
    structure = np.concatenate([operator.free[speeds], np.zeros((len(depths), size, nodes))], axis=2)
    change = chip.copy()
    change[:, :, size:] -= np.eye(nodes)
    return np.concatenate([structure + factor * operator.impulse[speeds] @ change, chip], axis=1)


def unstable_cuts(system: DelaySystem, speeds: Real, depths: Real, *, extra: int = 0) -> NDArray[np.bool_]:
    """Check for pairs of speed (rad/s) and depth (m) whether a multiplier lies on or beyond the unit circle."""
    result = np.zeros(len(speeds), dtype=bool)
    if system.process.is_turning:
        for speed in np.unique(speeds):
            result[speeds == speed] = unstable_turning(system, float(speed), depths[speeds == speed])
        return result
    if not system.process.is_plain:
        for pair, (speed, depth) in enumerate(zip(speeds, depths, strict=True)):
            cut = collocated_cut(system, float(speed), float(depth), extra=extra)
            result[pair] = leading_multipliers(cut).radius >= 1
        return result
    for pairs in speed_groups(speeds, 1.15) if len(speeds) else ():
        different, place = np.unique(speeds[pairs], return_inverse=True)
        operator = period_operator(system, 2 * np.pi / (system.process.teeth * different), extra=extra)
        size = operator.within.shape[1] + operator.free.shape[1]
        batches = int(np.ceil(len(pairs) * size**2 / 4e6))  # of at most four million matrix entries in memory
        for batch in np.array_split(np.arange(len(pairs)), batches):
            result[pairs[batch]] = growing(monodromies(operator, place[batch], depths[pairs[batch]]))
    return result


def largest_multipliers(system: DelaySystem, speeds: Real, depths: Real) -> tuple[Complex, Real]:
    """Compute the largest multiplier of each pair of speed (rad/s) and depth (m), and the period (s) it belongs to.

    The period is that of a tooth; with unequal teeth that of a revolution. Turning has no multipliers.
    """
    if not system.process.is_plain:
        cuts = [collocated_cut(system, float(speed), float(depth)) for speed, depth in zip(speeds, depths, strict=True)]
        largest = np.array([leading_multipliers(cut).values[0] for cut in cuts], dtype=complex)
        return largest, np.array([cut.duration for cut in cuts])
    periods = 2 * np.pi / (system.process.teeth * speeds)
    values = np.empty(len(speeds), dtype=complex)
    for pairs in speed_groups(speeds, 1.4) if len(speeds) else ():
        different, place = np.unique(periods[pairs], return_inverse=True)
        matrices = monodromies(period_operator(system, different), place, depths[pairs])
        values[pairs] = largest_first(np.linalg.eigvals(matrices).astype(complex))[:, 0]
    return values, periods


def growing(matrices: Real) -> NDArray[np.bool_]:
    """Check for each of n matrices (k, k) whether it has an eigenvalue on or beyond the unit circle.

    Matrices U are squared repeatedly, which is faster than eigenvalues. ``|U^N| < 1`` proves that no such eigenvalue
    exists; ``|U^N| > 1e12`` is taken as proof of such an eigenvalue, because no transient of a cut grows that far.

    Examples
    --------
    >>> growing(np.array([[[0.9, 5.0], [0.0, 0.8]], [[1.001, 0.0], [0.0, 0.2]]])).tolist()
    [False, True]
    """
    if matrices.shape[1] > 120:  # for a large matrix a few eigenvalues by Arnoldi's method are faster
        return np.array([_grows(matrix) for matrix in matrices], dtype=bool)
    result = np.zeros(len(matrices), dtype=bool)
    undecided, power = np.arange(len(matrices)), matrices
    for _ in range(22):  # N = 2^22: only multipliers within 1e-6 of the circle remain
        size = np.sqrt(np.einsum("nij,nij->n", power, power))
        result[undecided[size > 1e12]] = True
        open_ = (size >= 1) & (size <= 1e12)
        undecided, power = undecided[open_], power[open_]
        if not len(undecided):
            return result
        power = power @ power
    for k in undecided:
        result[k] = np.abs(np.linalg.eigvals(matrices[k])).max() >= 1
    return result


def _grows(matrix: Real) -> bool:
    """Check whether a large matrix has an eigenvalue on or beyond the unit circle."""
    start = np.cos(np.arange(len(matrix)) ** 1.3)  # fixed, so that results repeat
    try:
        values = scipy.sparse.linalg.eigs(
            matrix, k=6, v0=start, ncv=40, maxiter=60, tol=1e-12, return_eigenvectors=False
        )
    except scipy.sparse.linalg.ArpackError:
        values = np.linalg.eigvals(matrix)
    return bool(np.abs(values).max() >= 1)
