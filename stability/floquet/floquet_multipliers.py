"""Floquet multipliers of one cut, and what kind of loss of stability the largest of them means."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess
from foundation import InputError
from modal_fit import ModalModel

from ..milling_loop.delayed_state import delay_system
from .collocated_period import PeriodOperator, period_operator
from .varied_edges import varied_cut

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


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
