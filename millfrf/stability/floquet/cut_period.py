"""One period of any cut at one speed and depth as a chain of collocated pieces."""

import math
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from typing import Any

import numpy as np

from millfrf.core import Complex, Index, InputError, Real
from millfrf.core.compilation import compiled, inner_loop
from millfrf.cutting import (
    EarlierMotions,
    EdgeForces,
    EdgeSlices,
    MillingProcess,
    PieceNodes,
    ProfileElement,
    add_edge_forces,
    edge_example,
    edge_slices,
    summed_forces,
    table_height,
)

from ..milling_loop import DelaySystem
from ..settings import SETTINGS
from .collocated_period import radau_nodes
from .cut_layout import Pieces, pieces_of, teeth_of
from .period_map import CutPeriod
from .piece_response import piece_matrices

DIVIDE = (
    4  # slices of a profile for one in a simulation, where those that cut as a whole are summed once for all depths
)
# errors of a wave on the nodes of a piece: multipliers of random cylinders then err by up to 1e-5 and 1e-6 (below 1.02)
COARSE_ERROR, EXACT_ERROR = 1e-2, 1e-6


@dataclass(frozen=True)
class CollocatedCut:
    """A cut at one speed and depth, with its nodes."""

    period: CutPeriod
    pieces: Pieces
    speed: float  # rad/s
    duration: float  # s: a tooth period, or a revolution where teeth differ
    directions: Index  # of the forces

    @cached_property
    def _nodes(self) -> tuple[Real, Real]:
        count = self.period.forcing.shape[2] // len(self.pieces.begins)
        halves = (self.pieces.ends - self.pieces.begins)[:, None] / 2
        nodes, weights, *_ = _rule(count)
        return ((self.pieces.begins[:, None] + halves * (nodes + 1)) / self.speed).ravel(), (
            halves * weights / self.speed
        ).ravel()

    @property
    def times(self) -> Real:
        """Return the times of the nodes (n_nodes,), s."""
        return self._nodes[0]

    @property
    def weights(self) -> Real:
        """Return the weights of the quadrature over the period at the nodes (n_nodes,), s."""
        return self._nodes[1]


@dataclass(frozen=True)
class _Channels:
    """Motions and, with process damping, velocities of the tool on which forces depend, and the forces of a system."""

    forced: Index  # directions of the forces
    moving: Index  # directions of the motions
    seen: Complex  # (n_modes, channels): channels per modal coordinate
    left: Complex  # (n_modes, forces)
    direct: Real  # (channels, forces), m/N and m/s/N: at once


@lru_cache(maxsize=64)
def _channels(system: DelaySystem) -> _Channels:
    process = system.process
    elements = process.profile or (ProfileElement(0.0, process.edge_angle),)
    # the chip of a cylinder does not depend on Z
    tilted = any(element.curvature or abs(math.cos(element.edge_angle)) > 1e-12 for element in elements)
    moves = np.abs(system.right).any(axis=0) | np.abs(system.upper).any(axis=1)
    moving = np.flatnonzero(moves & np.array([True, True, tilted]))
    forced = np.flatnonzero(np.abs(system.left).any(axis=0))
    seen, direct = system.right[:, moving], system.upper[moving][:, forced]
    if process.process_damping:
        seen = np.concatenate([seen, seen * system.poles[:, None]], axis=1)
        direct = np.concatenate([direct, 2 * np.real(system.right[:, moving].T @ system.left[:, forced])])
    left = np.ascontiguousarray(system.left[:, forced])
    return _Channels(forced, moving, np.ascontiguousarray(seen), left, np.ascontiguousarray(direct))


def collocated_cut(
    system: DelaySystem, speed: float, depth: float, *, extra: int = 0, coarse: bool = False
) -> CollocatedCut:
    """Discretise one period at a spindle speed (rad/s) and a depth (m).

    In a piece the force is a polynomial at Radau's nodes, and the structure responds to it by its impulse response h:
    ``X_i = half sum_j Q_ij h(t_i - t_j) F_j`` with the matrix Q that integrates from the piece's beginning. Pieces end
    where the edges enter and leave the cut. No matrix of a whole period is formed, so that the work grows with the
    number of pieces and not with its cube. ``extra`` nodes in each piece show the discretisation error; ``coarse``
    nodes suffice to bracket a limit.

    Raises
    ------
    InputError
        Too many nodes, or edges that meet below the depth.
    """
    process, teeth, channels = system.process, teeth_of(system.process), _channels(system)
    slices = edge_slices(process, depth, DIVIDE if teeth.summed else 1)
    forces = summed_forces(process, table_height(depth), DIVIDE) if teeth.summed else teeth.forces
    fastest = float(np.abs(system.poles).max()) / speed
    pieces = pieces_of(process, slices, fastest)
    count = _node_count(process, pieces.widest, fastest, coarse) + extra
    nodes = len(pieces.begins) * count
    if nodes > SETTINGS.most_nodes:
        raise InputError(
            f"{nodes} nodes a period at {speed * 30 / np.pi:.4g} rpm: the modes turn too often; leave out the highest "
            "modes, or raise the speed"
        )
    rule, _, integral, barycentric = _rule(count)
    places = PieceNodes(pieces.begins, pieces.ends, teeth.period, rule, barycentric)
    # the fastest part of the edge: elsewhere process damping is larger, which is on the safe side
    flank = process.process_damping / (speed * slices.radii.max()) if process.process_damping else 0.0
    forcing, capacity = np.empty((0, 0, 0)), 0 if teeth.single_delay else nodes * process.teeth
    while not len(forcing):
        earlier = EarlierMotions.empty(nodes, count, capacity, channels.forced, channels.moving)
        forcing = _forcing(slices, forces, places, earlier, flank)
        capacity *= 2
    matrices = piece_matrices(
        system.poles,
        channels.seen,
        channels.left,
        channels.direct,
        pieces.begins / speed,
        pieces.ends / speed,
        teeth.period / speed,
        rule,
        integral,
        forcing,
    )
    period = CutPeriod(matrices, forcing, earlier.first, earlier.source, earlier.blocks)
    return CollocatedCut(period, pieces, speed, teeth.period / speed, channels.forced)


def _node_count(process: MillingProcess, widest: float, fastest: float, coarse: bool) -> int:
    """Return the number of nodes in pieces of up to a width (rad) in which the fastest mode turns by widest fastest.

    On n nodes a wave of the phase p has an error near ``(p / 2)^n / n!``, and at the end of a piece its square. The
    coefficients of a cylinder turn by twice the spindle's angle. Where entry and exit move along a profile within a
    piece, offsets decide, or coefficients depend on the chip, they are less smooth.
    """
    if process.profile or process.has_offsets or process.chip_law.varies:
        return (5 if coarse else 9) + math.ceil(0.9 * widest * fastest + 3.5 * widest)
    half, count, error = widest * (fastest + 2) / 2, 0, 1.0
    while error > (COARSE_ERROR if coarse else EXACT_ERROR) or count < (5 if coarse else 8):
        count += 1
        error *= half / count
    return count


def _forcing_example() -> tuple[Any, ...]:
    _, slices, forces, places, _, _, earlier = edge_example()
    return slices, forces, places, earlier, 0.0


@compiled(example=_forcing_example)
def _forcing(slices: EdgeSlices, forces: EdgeForces, places: PieceNodes, earlier: EarlierMotions, flank: float) -> Real:
    """Return the force per channel at the nodes, (forces, channels, n_nodes); empty: earlier motions need more room.

    ``flank`` is the damping force (N s/m) per width of the edge (m); 0: velocities are no channels.
    """
    # taken from their tuples once: to take them in a loop counts a reference, which takes longer than the arithmetic
    begins, ends, nodes = places.begins, places.ends, places.nodes
    acting, moving = earlier.forces, earlier.motions
    n, motions = len(begins) * len(nodes), len(moving)
    angles, cutting, normals = np.empty(n), np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
    _place(begins, ends, nodes, angles)
    if not add_edge_forces(angles, slices, forces, places, cutting, normals, earlier):
        return np.empty((0, 0, 0))
    result = np.empty((len(acting), motions if flank == 0.0 else 2 * motions, n))
    for a in range(len(acting)):
        for b in range(motions):
            result[a, b] = cutting[:, acting[a], moving[b]]
            if flank != 0.0:
                result[a, motions + b] = -flank * normals[:, acting[a], moving[b]]
    return result


@inner_loop
def _place(begins: Real, ends: Real, nodes: Real, angles: Real) -> None:
    """Write the spindle angles (rad) of the nodes."""
    count = len(nodes)
    for k in range(len(begins)):
        half = (ends[k] - begins[k]) / 2
        for i in range(count):
            angles[k * count + i] = begins[k] + half * (nodes[i] + 1.0)
        # the last node of a piece belongs to it: the teeth that leave the cut there still cut
        angles[k * count + count - 1] -= 1e-10


@cache
def _rule(count: int) -> tuple[Real, Real, Real, Real]:
    """Return Radau nodes, weights, the matrix that integrates from -1 to each node, and barycentric weights."""
    nodes, weights, derivative = radau_nodes(count)
    gaps = nodes[:, None] - nodes
    np.fill_diagonal(gaps, 0.5)
    return nodes, weights, np.ascontiguousarray(np.linalg.inv(derivative)), 1 / np.prod(2 * gaps, axis=1)
