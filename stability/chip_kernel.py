"""The regenerative loop on the cut alone: how chip thickness at one instant makes chip thickness at another."""

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from cutting import MillingProcess, chip_direction, force_direction

from .structure_states import StructureStates

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]


@dataclass(frozen=True)
class ChipKernel:
    """Discrete integral equation of the chip's modulation u over one tooth period.

    A solution with Floquet multiplier mu obeys ``u = a K_tc (1 - 1/mu) M(mu) u`` with
    ``M(mu) = direct + entering diag(1 / (mu - decay)) leaving``.

    Parameters
    ----------
    direct : (n, n), real
        Response to force earlier in the same period, from rest.
    entering : (n, n_states), leaving : (n_states, n)
        Chip that a free decay of the states makes; state at the period's end that the force leaves.
    decay : (n_states,)
        exp(pole T): how much of a state is left after a period.
    period
        T, s.
    """

    direct: Complex
    entering: Complex
    leaving: Complex
    decay: Complex
    period: float

    def matrices(self, multipliers: Complex) -> Complex:
        """``(1 - 1/mu) M(mu)``, shape (n_multipliers, n, n)."""
        gain = 1 / (multipliers[:, None] - self.decay)
        returned = np.einsum("is,ks,sj->kij", self.entering, gain, self.leaving, optimize=True)
        return np.asarray((1 - 1 / multipliers)[:, None, None] * (self.direct + returned))


def chip_kernel(
    states: StructureStates, process: MillingProcess, spindle_speed: float, nodes_per_segment: int
) -> ChipKernel:
    """Collocate the loop at Chebyshev points between every entry and exit of a tooth.

    Between entry and exit all coefficients are smooth, so that the error falls faster than any power of the number of
    nodes; across them nothing is interpolated (Butcher, Bobrenkov, Bueler & Nindujarla, J. Comput. Nonlinear Dyn. 4,
    2009, and Bachrathy & Stepan 2012, for methods of this kind). Outside the cut the states decay freely and exactly.

    Parameters
    ----------
    states
        Structure at the tool.
    process
        Cutter with teeth of equal pitch.
    spindle_speed
        rad/s.
    nodes_per_segment
        Chebyshev intervals in each stretch between two events.
    """
    pitch = 2 * math.pi / process.teeth
    period = pitch / spindle_speed
    unit, differentiation = chebyshev(nodes_per_segment)
    edges = _events(process, pitch)
    n_states = len(states.poles)
    # decay from the period's start to the present point, and what each chip sample has left in the states there
    passed = np.ones(n_states, dtype=complex)
    left = np.zeros((n_states, 0), dtype=complex)
    rows_direct: list[Complex] = []
    rows_entering: list[Complex] = []
    for low, high in pairwise(edges):
        duration = (high - low) / spindle_speed
        cutting = _teeth_in_cut(process, pitch, 0.5 * (low + high))
        if not cutting:
            fade = np.exp(states.poles * duration)
            passed, left = passed * fade, left * fade[:, None]
            continue
        angles = low + (high - low) * unit[1:]
        toward, along = _directions(process, pitch, angles, cutting)
        step = differentiation / duration
        response, homogeneous = _collocated(states.poles, step)
        forced = np.einsum("sq,tiq->sti", states.inputs, along)  # state s driven by tooth t at node i
        seen = np.einsum("tip,ps->tis", toward, states.outputs)  # chip of tooth t at node i from state s
        n_teeth, n_nodes = len(cutting), len(angles)
        own = np.einsum("tis,sij,suj->tiuj", seen, response, forced, optimize=True)
        earlier = np.einsum("tis,si,sc->tic", seen, homogeneous, left, optimize=True)
        start = np.einsum("tis,si,s->tis", seen, homogeneous, passed, optimize=True)
        rows_direct.append(
            np.concatenate([earlier.reshape(n_teeth * n_nodes, -1), own.reshape(n_teeth * n_nodes, -1)], axis=1)
        )
        rows_entering.append(start.reshape(n_teeth * n_nodes, n_states))
        fresh = np.einsum("sj,suj->suj", response[:, -1], forced).reshape(n_states, -1)
        left = np.concatenate([left * homogeneous[:, -1:], fresh], axis=1)
        passed = passed * homogeneous[:, -1]
    n = left.shape[1]
    direct = np.zeros((n, n), dtype=complex)
    row = 0
    for block in rows_direct:
        direct[row : row + len(block), : block.shape[1]] = block
        row += len(block)
    return ChipKernel(direct, np.concatenate(rows_entering), left, np.exp(states.poles * period), period)


def chebyshev(n: int) -> tuple[Real, Real]:
    """Chebyshev points on 0 ... 1, rising, and their differentiation matrix (Trefethen, Spectral Methods, ch. 6).

    Examples
    --------
    >>> x, d = chebyshev(8)
    >>> bool(np.allclose(d @ x**3, 3 * x**2))
    True
    """
    k = np.arange(n + 1)
    x = -np.cos(math.pi * k / n)
    c = np.where((k == 0) | (k == n), 2.0, 1.0) * (-1.0) ** k
    difference = x[:, None] - x[None, :] + np.eye(n + 1)
    matrix = np.outer(c, 1 / c) / difference
    matrix -= np.diag(matrix.sum(axis=1))
    return (x + 1) / 2, 2 * matrix


def _collocated(poles: Complex, step: Real) -> tuple[Complex, Complex]:
    """Solve ``z' = p z + g``: response at nodes 1..n to g there, (n_states, n, n), and to the start, (n_states, n)."""
    n = len(step) - 1
    systems = step[1:, 1:] - poles[:, None, None] * np.eye(n)
    inverse = np.linalg.inv(systems)
    return np.asarray(inverse, dtype=np.complex128), np.asarray(-(inverse @ step[1:, 0].astype(complex)))


def _events(process: MillingProcess, pitch: float) -> Real:
    """Angles in 0 ... pitch at which a tooth enters or leaves, with both ends."""
    inside = [math.fmod(angle, pitch) for angle in (process.start_angle, process.exit_angle)]
    edges = np.array(sorted({0.0, pitch, *inside}))
    keep = np.concatenate([[True], np.diff(edges) > 1e-9 * pitch])
    edges = edges[keep]
    edges[-1] = pitch
    return np.asarray(edges, dtype=np.float64)


def _teeth_in_cut(process: MillingProcess, pitch: float, angle: float) -> list[int]:
    turned = [(tooth, angle + tooth * pitch) for tooth in range(process.teeth)]
    return [tooth for tooth, phi in turned if process.start_angle <= phi < process.exit_angle]


def _directions(process: MillingProcess, pitch: float, angles: Real, teeth: list[int]) -> tuple[Real, Real]:
    """Chip and force directions of each engaged tooth at each node, (n_teeth, n_nodes, 3) twice."""
    turned = [angles + tooth * pitch for tooth in teeth]
    toward = np.array([chip_direction(process, phi) for phi in turned])
    return toward, np.array([force_direction(process, phi) for phi in turned])
