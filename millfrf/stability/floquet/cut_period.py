"""One period of any cut as a chain of collocated pieces: matrices of each piece, and the motion that they pass on."""

import math
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, NamedTuple

import numpy as np

from millfrf.core import Complex, Index, InputError, Real
from millfrf.core.compilation import compiled, inner_loop
from millfrf.cutting import (
    EarlierMotions,
    EdgeForces,
    EdgeSlices,
    MillingProcess,
    PieceNodes,
    add_edge_forces,
    edge_slices,
    summed_forces,
    table_height,
    thin_chip_immersions,
)

from ..milling_loop import DelaySystem
from ..settings import SETTINGS
from .collocated_period import radau_nodes
from .piece_response import piece_matrices

DIVIDE = (
    4  # slices of a profile for one in a simulation, where those that cut as a whole are summed once for all depths
)
LARGEST_PHASE = 5.0  # rad; of the fastest mode in a piece: the cheapest for (phase + 10)^3 / phase operations


class CutPeriod(NamedTuple):
    """Matrices of the pieces of one period at one speed and depth.

    The channels W are the tool's motions that change the chip and, with process damping, their velocities. With the
    structure's state z = (Re q, Im q) at the beginning of a piece and the force B of the earlier motions at its nodes,
    W at the nodes and z at the end are ``(W, z) = steps (z, B)``. Between two pieces the structure moves freely: ``q``
    is multiplied by ``gaps``. The force is ``forcing W - B``.
    """

    steps: Real  # (n_pieces, count channels + size, size + count forces)
    gaps: Complex  # (n_pieces + 1, n_modes)
    forcing: Real  # (n_nodes, forces, channels)
    first: Index  # (n_nodes + 1,): first block of each node
    source: Index  # (n_blocks,): piece whose motion a block takes, plus n_pieces in the period before
    blocks: Real  # (n_blocks, forces, count, motions): force per motion at the nodes of the source
    # without blocks the delayed force is that of the motion at the same node one period earlier

    @property
    def size(self) -> int:
        """Return the length of a vector of state and channels at all nodes."""
        return int(2 * self.gaps.shape[1] + self.forcing.shape[0] * self.forcing.shape[2])


@dataclass(frozen=True)
class CollocatedCut:
    """A cut at one speed and depth, with its nodes."""

    period: CutPeriod
    times: Real  # (n_nodes,), s
    weights: Real  # (n_nodes,), s: of the quadrature over the period
    duration: float  # s: a tooth period, or a revolution where teeth differ
    directions: Index  # of the forces


def single_delay(process: MillingProcess) -> bool:
    """Check whether all teeth cut the surface of the tooth before them at the same angle, one tooth period ago."""
    return process.equal_pitch and len(set(process.helices)) == 1 and not process.has_offsets


def period_angle(process: MillingProcess) -> float:
    """Return the spindle angle (rad) after which the cut repeats: one tooth, or one revolution where teeth differ."""
    return 2 * math.pi / process.teeth if single_delay(process) else 2 * math.pi


def collocated_cut(system: DelaySystem, speed: float, depth: float, *, extra: int = 0) -> CollocatedCut:
    """Discretise one period at a spindle speed (rad/s) and a depth (m).

    In a piece the force is a polynomial at Radau's nodes, and the structure responds to it by its impulse response h:
    ``X_i = half sum_j Q_ij h(t_i - t_j) F_j`` with the matrix Q that integrates from the piece's beginning. Pieces end
    where the edges enter and leave the cut. No matrix of a whole period is formed, so that the work grows with the
    number of pieces and not with its cube.

    Raises
    ------
    InputError
        Too many nodes, or edges that meet below the depth.
    """
    process, teeth = system.process, _teeth(system.process)
    slices = edge_slices(process, depth, DIVIDE if teeth.summed else 1)
    edges = _piece_edges(slices, teeth.forces.aheads, _switch_angles(teeth, slices), teeth.period)
    shortest = math.inf if teeth.single_delay else _shortest_delay(process, slices)
    fastest = float(np.abs(system.poles).max()) / speed
    begins, ends, widest = _pieces(edges, fastest, min(shortest, 0.4 if process.has_offsets else 1.6))
    count = 9 + extra + math.ceil(0.9 * widest * fastest + 3.5 * widest)
    if len(begins) * count > SETTINGS.most_nodes:
        raise InputError(
            f"{len(begins) * count} nodes a period at {speed * 30 / np.pi:.4g} rpm: the modes turn too often; leave "
            "out the highest modes, or raise the speed"
        )
    nodes, weights, integral, barycentric = _rule(count)
    halves = (ends - begins) / 2
    angles = (begins[:, None] + halves[:, None] * (nodes + 1)).ravel()
    pieces = PieceNodes(begins, ends, teeth.period, nodes, barycentric)
    cutting, normals, earlier = _edge_matrices(process, depth, slices, angles, pieces)
    forced = np.flatnonzero(np.abs(system.left).any(axis=0))
    seen, direct, forcing, moving = _channels(system, speed, slices, cutting, normals, forced)
    matrices = piece_matrices(
        system.poles,
        seen,
        np.ascontiguousarray(system.left[:, forced]),
        direct,
        begins / speed,
        ends / speed,
        teeth.period / speed,
        nodes,
        integral,
        forcing,
    )
    blocks = np.ascontiguousarray(earlier.blocks[:, forced][..., moving])
    return CollocatedCut(
        CutPeriod(*matrices, forcing, earlier.first, earlier.source, blocks),
        angles / speed,
        (halves[:, None] * weights).ravel() / speed,
        teeth.period / speed,
        forced,
    )


def _channels(
    system: DelaySystem, speed: float, slices: EdgeSlices, cutting: Real, normals: Real, forced: Index
) -> tuple[Complex, Real, Real, Index]:
    """Return the channels per modal coordinate and per force, the force per channel, and the directions of motion."""
    moves = np.abs(system.right).any(axis=0) | np.abs(system.upper).any(axis=1)
    tilted = (np.abs(np.cos(slices.edge_angles)) > 1e-12).any()  # the chip of a cylinder does not depend on Z
    moving = np.flatnonzero(moves & np.array([True, True, tilted]))
    seen, direct = system.right[:, moving], system.upper[moving][:, forced]
    forcing = cutting[:, forced][..., moving]
    if system.process.process_damping:
        # the fastest part of the edge: elsewhere process damping is larger, which is on the safe side
        flank = normals[:, forced][..., moving] * (system.process.process_damping / (speed * slices.radii.max()))
        at_once = 2 * np.real(system.right[:, moving].T @ system.left[:, forced])
        seen = np.concatenate([seen, seen * system.poles[:, None]], axis=1)
        direct, forcing = np.concatenate([direct, at_once]), np.concatenate([forcing, -flank], axis=2)
    return np.ascontiguousarray(seen), np.ascontiguousarray(direct), np.ascontiguousarray(forcing), moving


class _Teeth(NamedTuple):
    """Constants of a process."""

    forces: EdgeForces
    summed: bool  # whether slices that cut as a whole are summed once for all depths
    single_delay: bool
    period: float  # rad
    switches: Real  # (teeth, n), rad: immersions at which another earlier tooth left the surface, or the law changes


@lru_cache(maxsize=64)
def _teeth(process: MillingProcess) -> _Teeth:
    single = single_delay(process)
    summed = single and bool(process.profile) and not (process.chip_law.varies or process.is_turning)
    return _Teeth(EdgeForces.of(process), summed, single, period_angle(process), _switches(process))


def _switches(process: MillingProcess) -> Real:
    """Return immersions (rad) of each tooth between which its force per motion is smooth, (teeth, n), else NaN."""
    teeth = range(process.teeth)
    rows = [(*thin_chip_immersions(process, tooth), *_changes_of_pass(process, tooth)) for tooth in teeth]
    switches = np.full((process.teeth, max(map(len, rows))), np.nan)
    for row, angles in zip(switches, rows, strict=True):
        row[: len(angles)] = angles
    return switches


def _changes_of_pass(process: MillingProcess, tooth: int) -> list[float]:
    """Return the immersions (rad) between which a tooth cuts what one earlier tooth left, or nothing.

    ``h_k = f_k sin(phi) + rho_j - rho_(j+k)`` for the feed f_k since the tooth j + k passed; k of the least, or none
    where it is not positive.
    """
    if not process.runout_decides:
        return []
    teeth = process.teeth
    offsets = process.runout * np.cos(2 * np.pi * np.arange(teeth) / teeth)
    order = (tooth + np.arange(1, teeth + 1)) % teeth
    ahead = np.cumsum(np.roll(process.pitches, -tooth))
    feeds = np.append(process.feed_per_tooth * teeth * ahead / (2 * np.pi), 0.0)
    heights = np.append(offsets[tooth] - offsets[order], 0.0)  # the last: no chip
    with np.errstate(divide="ignore", invalid="ignore"):
        sines = (heights[None, :] - heights[:, None]) / (feeds[:, None] - feeds[None, :])
    sines = np.unique(sines[(sines > 0) & (sines < 1)])
    both = [np.argmin(feeds[:, None] * (sines + shift) + heights[:, None], axis=0) for shift in (-1e-9, 1e-9)]
    angles = np.arcsin(sines[both[0] != both[1]])
    return [*angles.tolist(), *(np.pi - angles).tolist()]


def _edge_matrices(
    process: MillingProcess, depth: float, slices: EdgeSlices, angles: Real, pieces: PieceNodes
) -> tuple[Real, Real, EarlierMotions]:
    """Return force per motion, ``n n^T`` (n, 3, 3) and blocks of the force per earlier motion."""
    teeth, count, n = _teeth(process), len(pieces.nodes), len(angles)
    # the last node of a piece belongs to it: the teeth that leave the cut there still cut
    inner = angles.copy()
    inner[count - 1 :: count] -= 1e-10
    capacity = 0 if teeth.single_delay else n * process.teeth
    forces = summed_forces(process, table_height(depth), DIVIDE) if teeth.summed else teeth.forces
    while True:
        cutting, normals = np.zeros((n, 3, 3)), np.zeros((n, 3, 3))
        earlier = EarlierMotions(
            np.zeros(n + 1, dtype=np.int64), np.zeros(capacity, dtype=np.int64), np.zeros((capacity, 3, count, 3))
        )
        if add_edge_forces(inner, slices, forces, pieces, cutting, normals, earlier):
            break
        capacity *= 2
    used = earlier.first[-1]
    return cutting, normals, EarlierMotions(earlier.first, earlier.source[:used], earlier.blocks[:used])


def _switch_angles(teeth: _Teeth, slices: EdgeSlices) -> Real:
    """Return the spindle angles (rad) of the switches at the tip and at the top of the edges."""
    ends = [lags[:, None] - teeth.forces.aheads[:, None] for lags in (slices.lags[:, 0, 0], slices.lags[:, -1, 1])]
    angles = np.concatenate([teeth.switches + end for end in ends], axis=None)
    return np.asarray(angles[np.isfinite(angles)])


def _edges_example() -> tuple[Any, ...]:
    rows, numbers = np.zeros((1, 2)), np.zeros(1)
    return EdgeSlices(rows[None], rows, rows, rows, numbers, rows[None], rows), numbers, numbers, 1.0


@compiled(example=_edges_example)
def _piece_edges(slices: EdgeSlices, aheads: Real, switches: Real, period: float) -> Real:
    """Return the spindle angles (rad) between which edges are in the cut, (n, 2), divided at entries and exits.

    Entries and exits count at the ends of the profile's elements. Elsewhere they move smoothly from slice to slice.
    At the spindle angles ``switches`` (n,), rad, another earlier tooth left the surface.
    """
    teeth, rows = len(aheads), len(slices.widths)
    low, high = np.full(teeth, np.inf), np.full(teeth, -np.inf)
    corners = [0.0, period]
    for tooth in range(teeth):
        for row in range(rows):
            for end in range(2):
                entry = slices.starts[row, end] + slices.lags[tooth, row, end] - aheads[tooth]
                leave = slices.exits[row, end] + slices.lags[tooth, row, end] - aheads[tooth]
                low[tooth], high[tooth] = min(low[tooth], entry), max(high[tooth], leave)
                neighbour = row - 1 if end == 0 else row + 1
                if (
                    not 0 <= neighbour < rows
                    or abs(slices.edge_angles[neighbour, 1 - end] - slices.edge_angles[row, end]) > 1e-9
                ):
                    corners.append(entry % period)
                    corners.append(leave % period)
        corners.append(low[tooth] % period)
        corners.append(high[tooth] % period)
    marks = np.sort(np.concatenate((np.array(corners), switches % period)))
    edges = np.empty((len(marks), 2))
    count, begin = 0, 0.0
    for mark in marks:
        if mark - begin < 1e-9 or (period - mark < 1e-9 and mark != period):
            continue
        middle = (begin + mark) / 2
        for tooth in range(teeth):
            if (middle - low[tooth]) % period < high[tooth] - low[tooth]:
                edges[count, 0], edges[count, 1] = begin, mark
                count += 1
                break
        begin = mark
    return edges[:count].copy()


def check_edges(process: MillingProcess, depth: float) -> None:
    """Refuse a depth (m) that the edges do not reach, or below which two of them meet.

    Raises
    ------
    InputError
        The height of the last element, or the least angle between two edges.
    """
    _shortest_delay(process, edge_slices(process, depth))


def _shortest_delay(process: MillingProcess, slices: EdgeSlices) -> float:
    """Return the smallest angle (rad) between an edge and the edge before it, at any height."""
    delays = [
        pitch - slices.lags[(tooth + 1) % process.teeth] + slices.lags[tooth]
        for tooth, pitch in enumerate(process.pitches)
    ]
    shortest = float(np.min(delays))
    if shortest < math.radians(1.0):
        raise InputError(
            f"two edges come within {math.degrees(shortest):.3g} deg of each other below this depth, as their helix "
            "angles differ; lower the largest depth"
        )
    return shortest


@compiled("(float64[:,::1], float64, float64)")
def _pieces(edges: Real, fastest: float, largest: float) -> tuple[Real, Real, float]:
    """Divide intervals (n, 2), rad, into pieces; return their begins and ends, and the width of the widest.

    ``fastest`` is the phase (rad) by which the fastest mode advances per radian of the spindle.
    """
    longest = min(LARGEST_PHASE / fastest, 0.999 * largest)
    begins, ends, widest = [0.0], [0.0], 0.0
    for k in range(len(edges)):
        count = max(1, int(np.ceil((edges[k, 1] - edges[k, 0]) / longest - 1e-9)))
        width = (edges[k, 1] - edges[k, 0]) / count
        widest = max(widest, width)
        for number in range(count):
            begins.append(edges[k, 0] + number * width)
            ends.append(edges[k, 0] + (number + 1) * width)
    return np.array(begins[1:]), np.array(ends[1:]), widest


@cache
def _rule(count: int) -> tuple[Real, Real, Real, Real]:
    """Return Radau nodes, weights, the matrix that integrates from -1 to each node, and barycentric weights."""
    nodes, weights, derivative = radau_nodes(count)
    gaps = nodes[:, None] - nodes
    np.fill_diagonal(gaps, 0.5)
    return nodes, weights, np.ascontiguousarray(np.linalg.inv(derivative)), 1 / np.prod(2 * gaps, axis=1)


def period_example() -> tuple[Any, ...]:
    three, numbers = np.zeros((1, 1, 1)), np.zeros(2, dtype=np.int64)
    gaps, blocks = np.zeros((2, 1), dtype=complex), np.zeros((0, 1, 1, 1))
    return CutPeriod(three, gaps, three, numbers, numbers, blocks), np.zeros(3)


@inner_loop
def _block_force(blocks: Real, block: int, direction: int, motion: Real, start: int, channels: int) -> float:
    """Return the force of a block for the motions at the nodes of its piece, which begin at ``start``."""
    total = 0.0
    for c in range(blocks.shape[2]):
        for b in range(blocks.shape[3]):
            total += blocks[block, direction, c, b] * motion[start + c * channels + b]
    return total


@inner_loop
def _earlier_force(
    forcing: Real,
    first: Index,
    source: Index,
    blocks: Real,
    piece: int,
    pieces: int,
    before: Real,
    now: Real,
    size: int,
    force: Real,
) -> None:
    """Write the force of earlier motions at the nodes of a piece after the state; channels at nodes follow a state."""
    forces, channels = forcing.shape[1], forcing.shape[2]
    count, motions = len(forcing) // pieces, blocks.shape[3]
    for i in range(count):
        node = piece * count + i
        for a in range(forces):
            total = 0.0
            if not len(blocks):
                for b in range(motions):
                    total += forcing[node, a, b] * before[size + node * channels + b]
            for block in range(first[node], first[node + 1]):
                start = size + (source[block] % pieces) * count * channels
                motion = before if source[block] >= pieces else now
                total += _block_force(blocks, block, a, motion, start, channels)
            force[size + i * forces + a] = total


@compiled(example=period_example)
def next_period(cut: CutPeriod, vector: Real) -> tuple[Real, Real]:
    """Return state and channels (state, then nodes) after one period, and the force (n_nodes, forces) at the nodes.

    ``vector`` holds the structure's state at the beginning, and the channels at the nodes of the period before.
    """
    # taken from their tuple once: to take them in a loop counts a reference, which takes longer than the arithmetic
    steps, gaps, forcing, first, source, blocks = cut
    (pieces, rows, columns), modes = steps.shape, gaps.shape[1]
    size, channels, n_forces = 2 * modes, forcing.shape[2], forcing.shape[1]
    n, count = rows - size, len(forcing) // pieces
    result, force, driven = np.zeros_like(vector), np.empty((len(forcing), n_forces)), np.empty(columns)
    driven[:size] = vector[:size]
    for k in range(pieces + 1):
        for r in range(modes):
            moved = complex(driven[r], driven[modes + r]) * gaps[k, r]
            driven[r], driven[modes + r] = moved.real, moved.imag
        if k == pieces:
            break
        _earlier_force(forcing, first, source, blocks, k, pieces, vector, result, size, driven)
        motion = np.dot(steps[k], driven)
        for i in range(n):
            result[size + k * n + i] = motion[i]
        for i in range(count):
            node = k * count + i
            for a in range(n_forces):
                force[node, a] = -driven[size + i * n_forces + a]
                for b in range(channels):
                    force[node, a] += forcing[node, a, b] * motion[i * channels + b]
        for r in range(size):
            driven[r] = motion[n + r]
    result[:size] = driven[:size]
    return result, force
