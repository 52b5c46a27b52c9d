"""Force of sliced edges per motion of the tool, now and in the passes that left the surface; compiled."""

import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from millfrf.core import Real
from millfrf.core.compilation import compiled, inner_loop

from .chip_law import relative_pressure
from .earlier_motions import EarlierMotions, PieceNodes, add_earlier
from .process import TURNING_IMMERSION, MillingProcess
from .profile import EdgeSlices, whole_slices
from .tooth import specific_forces

# four Gauss points in (0, 1)
_POINTS = tuple((0.5 * (np.polynomial.legendre.leggauss(4)[0] + 1)).tolist())
_WEIGHTS = tuple((0.5 * np.polynomial.legendre.leggauss(4)[1]).tolist())
ANGLES = 5  # of the tip


class EdgeForces(NamedTuple):
    """What the force of an edge depends on besides its slices."""

    aheads: Real  # (teeth,), rad: by which each tooth is ahead of tooth 0
    pitches: Real  # (teeth,), rad: from each tooth to the next
    coefficients: Real  # (3,), Pa: Ktc, Krc, Kac
    feed: float  # m per revolution
    by_offsets: bool  # whether the deepest of all earlier passes left the surface; else the tooth before left it
    fixed: bool  # whether the only edge keeps its direction, as in turning
    exponents: Real  # (3,): of the chip thickness
    reference: float  # m: chip thickness at which the coefficients hold
    edge_radius: float  # m: chips below it have the coefficients of this thickness
    # (n_slices + 1, 5, 2, 3, 3): force per motion and n n^T, as in `add_edge_forces`, of all whole slices before each
    # that cut, at five equal angles of the tip; without slices all forces are integrated anew
    sums: Real

    @classmethod
    def of(cls, process: MillingProcess) -> "EdgeForces":
        """Return what the force of a process's edges depends on."""
        law = process.chip_law
        return cls(
            np.array(process.tooth_angles),
            np.array(process.pitches),
            specific_forces(process)[0],
            process.feed_per_tooth * process.teeth,
            process.has_offsets,
            process.is_turning,
            np.array(law.exponents),
            law.reference,
            law.edge_radius,
            np.zeros((0, ANGLES, 2, 3, 3)),
        )


@lru_cache(maxsize=64)
def summed_forces(process: MillingProcess, height: float, divide: int) -> EdgeForces:
    """Return what the force of edges depends on, with sums of ``whole_slices(process, height, divide)``.

    All teeth have the same helix, and the chip no exponents: the force of an edge is then a trigonometric polynomial of
    its immersion, of the second degree, which five angles determine.
    """
    forces = EdgeForces.of(process)
    return forces._replace(sums=_edge_sums(whole_slices(process, height, divide).slices, forces))


def edge_example() -> tuple[Any, ...]:
    """Return arguments of :func:`add_edge_forces`, for the types of compiled functions that call it."""
    three, rows = np.zeros(3), np.zeros((1, 2))
    slices = EdgeSlices(np.zeros((3, 1, 2)), rows, rows, rows, np.zeros(1), np.zeros((3, 1, 2)), rows)
    matrices, directions = np.zeros((1, 3, 3)), np.arange(3)
    earlier = EarlierMotions.empty(1, 3, 1, directions, directions)
    nodes = PieceNodes(three, three, 1.0, three, three)
    forces = EdgeForces(three, three, three, 0.0, False, False, three, 1.0, 0.0, np.zeros((0, ANGLES, 2, 3, 3)))
    return three, slices, forces, nodes, matrices, matrices, earlier


@compiled(example=lambda: edge_example()[1:3])
def _edge_sums(slices: EdgeSlices, forces: EdgeForces) -> Real:
    """Return the field ``sums`` of `EdgeForces` from whole slices."""
    rows = len(slices.widths)
    coefficients = forces.coefficients[0], forces.coefficients[1], forces.coefficients[2]
    sums, matrix, normal = np.zeros((rows + 1, ANGLES, 2, 3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for row in range(rows):
        sums[row + 1] = sums[row]
        for q in range(len(_POINTS)):
            lag, kappa = _at(slices.lags, 0, row, _POINTS[q]), _between(slices.edge_angles, row, _POINTS[q])
            for k in range(ANGLES):
                phi = 2 * math.pi * k / ANGLES - lag
                _edge(phi, kappa, _WEIGHTS[q] * slices.widths[row], coefficients, matrix, normal)
                sums[row + 1, k, 0] += matrix
                sums[row + 1, k, 1] += normal
    return sums


@inner_loop
def _between(ends: Real, row: int, u: float) -> float:
    return float(ends[row, 0] + u * (ends[row, 1] - ends[row, 0]))


@inner_loop
def _engaged(tip: float, lag: tuple[float, float], starts: Real, exits: Real, row: int) -> tuple[float, float]:
    """Return the part (low, high) of a slice, in 0 ... 1, in which the edge is in the cut; low = high: none.

    At the share u of the slice the immersion is ``tip - lag(u)``, and lag, start and exit are linear in u.
    """
    low, high = 0.0, 1.0
    for bound in range(2):
        if bound == 0:
            begin, end = tip - lag[0] - starts[row, 0], tip - lag[1] - starts[row, 1]
        else:
            begin, end = exits[row, 0] - tip + lag[0], exits[row, 1] - tip + lag[1]
        if begin < 0.0 and end < 0.0:
            return 0.0, 0.0
        if begin < 0.0:
            low = max(low, begin / (begin - end))
        elif end < 0.0:
            high = min(high, begin / (begin - end))
    return low, max(low, high)


@inner_loop
def _at(ends: Real, tooth: int, row: int, u: float) -> float:
    return float(ends[tooth, row, 0] + u * (ends[tooth, row, 1] - ends[tooth, row, 0]))


@inner_loop
def _last_pass(
    slices: EdgeSlices, forces: EdgeForces, tooth: int, row: int, u: float, sine: float
) -> tuple[float, float]:
    """Return the delay (rad) to the pass that left the surface, and the chip (m) over the sine of the edge angle.

    ``h_k = f_rev delay_k / (2 pi) sin(phi) + rho_j - rho_(j+k)``: the deepest of the surfaces that all teeth left
    during the last revolution counts, and with a chip of zero or less the tooth misses the cut. Where offsets do not
    decide, the surface of the tooth before it counts.
    """
    lags, offsets, pitches, feed = slices.lags, slices.offsets, forces.pitches, forces.feed
    teeth = len(pitches)
    own, level = _at(lags, tooth, row, u), _at(offsets, tooth, row, u)
    ahead, delay, thinnest = 0.0, 0.0, np.inf
    for k in range(1, teeth + 1):
        other = (tooth + k) % teeth
        ahead += pitches[(tooth + k - 1) % teeth]
        earlier = ahead - _at(lags, other, row, u) + own
        if not forces.by_offsets:
            return earlier, feed * earlier / (2 * math.pi) * sine
        chip = feed * earlier / (2 * math.pi) * sine + level - _at(offsets, other, row, u)
        if chip < thinnest:
            thinnest, delay = chip, earlier
    return delay, thinnest


@compiled(example=edge_example)
def add_edge_forces(
    angles: Real,
    slices: EdgeSlices,
    forces: EdgeForces,
    pieces: PieceNodes,
    cutting: Real,
    normals: Real,
    earlier: EarlierMotions,
) -> bool:
    """Add up the force of the edges per motion of the tool at spindle angles (n,), rad.

    ``F(angle) = cutting X(angle) - sum of blocks (earlier motions at the nodes of a piece)``. Return whether the blocks
    have room for all earlier motions.

    Parameters
    ----------
    angles : (n,), rad
        Spindle angles: the immersion of tooth 0 at its tip; those of the nodes of ``pieces`` if there is any.
    slices, forces
        Edges in the cut.
    pieces
        Nodes between which earlier motions are interpolated.
    cutting, normals : (n, 3, 3)
        Receive the force per present motion, N/m, and the integral of ``n n^T`` over the edges' width, m.
    earlier
        Receives the force per earlier motion; without blocks, earlier motions are left out.
    """
    last, matrices = 0, (np.empty((3, 3)), np.empty((3, 3)))
    bounds = np.zeros((4, len(slices.widths) + 1 if len(forces.sums) else 0))
    if len(forces.sums):
        _bound(slices, bounds)
    for i in range(len(angles)):
        if len(earlier.blocks):
            earlier.first[i] = last
        last = _add_node(i, angles[i], slices, forces, pieces, (cutting, normals), earlier, matrices, bounds, last)
        if last < 0:
            return False
    if len(earlier.blocks):
        earlier.first[len(angles)] = last
    return True


@inner_loop
def _add_node(
    node: int,
    angle: float,
    slices: EdgeSlices,
    forces: EdgeForces,
    pieces: PieceNodes,
    sums: tuple[Real, Real],
    earlier: EarlierMotions,
    matrices: tuple[Real, Real],
    bounds: Real,
    last: int,
) -> int:
    """Add up the force of all edges at a node; return the number of blocks in use, -1 if there is no room."""
    if forces.fixed:
        for row in range(len(slices.widths)):
            at = (node, 0, row, angle, TURNING_IMMERSION)
            last = _add_part(at, (0.0, 1.0), slices, forces, pieces, sums, earlier, matrices, last)
        return last
    if len(forces.sums):
        _add_summed(node, angle, slices, forces, pieces, sums, earlier, matrices, bounds)
        return last
    for tooth in range(len(forces.pitches)):
        tip = (angle + forces.aheads[tooth]) % (2 * math.pi)
        for row in range(len(slices.widths)):
            lag = slices.lags[tooth, row, 0], slices.lags[tooth, row, 1]
            for turn in range(int(max(lag[0], lag[1]) / (2 * math.pi)) + 2):
                turned = tip + 2 * math.pi * turn
                part = _engaged(turned, lag, slices.starts, slices.exits, row)
                if part[0] < part[1]:
                    at = (node, tooth, row, angle, turned)
                    last = _add_part(at, part, slices, forces, pieces, sums, earlier, matrices, last)
                    if last < 0:
                        return last
    return last


@inner_loop
def _add_summed(
    node: int,
    angle: float,
    slices: EdgeSlices,
    forces: EdgeForces,
    pieces: PieceNodes,
    sums: tuple[Real, Real],
    earlier: EarlierMotions,
    matrices: tuple[Real, Real],
    bounds: Real,
) -> None:
    """Add up the force at a node of edges that share a helix: slices that cut as a whole are summed already."""
    rows = len(slices.widths)
    turns = int(slices.lags[0, rows - 1, 1] / (2 * math.pi)) + 2
    for tooth in range(len(forces.pitches)):
        tip = (angle + forces.aheads[tooth]) % (2 * math.pi)
        for turn in range(turns):
            turned, first = tip + 2 * math.pi * turn, -1
            if turned <= bounds[0, rows] or turned >= bounds[3, rows]:
                continue
            for row in range(rows):
                if bounds[1, row] <= turned <= bounds[2, row] and row < rows - 1:  # the last ends at the depth
                    first = row if first < 0 else first
                    continue
                if first >= 0:
                    _add_whole(node, turned, forces.sums, first, row, sums)
                    first = -1
                if bounds[0, row] < turned < bounds[3, row]:
                    lag = slices.lags[0, row, 0], slices.lags[0, row, 1]
                    part = _engaged(turned, lag, slices.starts, slices.exits, row)
                    at = (node, tooth, row, angle, turned)
                    _add_part(at, part, slices, forces, pieces, sums, earlier, matrices, 0)


@inner_loop
def _bound(slices: EdgeSlices, bounds: Real) -> None:
    """Write the immersions of the tip at which each slice begins to cut, cuts as a whole, ceases to, and is out.

    The last column has those of all slices together.
    """
    rows = len(slices.widths)
    bounds[0, rows], bounds[3, rows] = np.inf, -np.inf
    for row in range(rows):
        enter, leave = slices.lags[0, row, 0] + slices.starts[row, 0], slices.lags[0, row, 0] + slices.exits[row, 0]
        above = slices.lags[0, row, 1] + slices.starts[row, 1], slices.lags[0, row, 1] + slices.exits[row, 1]
        bounds[0, row], bounds[1, row] = min(enter, above[0]), max(enter, above[0])
        bounds[2, row], bounds[3, row] = min(leave, above[1]), max(leave, above[1])
        bounds[0, rows] = min(bounds[0, rows], bounds[0, row])
        bounds[3, rows] = max(bounds[3, rows], bounds[3, row])


@inner_loop
def _add_whole(node: int, tip: float, whole: Real, first: int, last: int, sums: tuple[Real, Real]) -> None:
    """Add up the force of the slices from ``first`` to the one before ``last`` at an immersion of the tip, rad."""
    for k in range(ANGLES):
        cosine = math.cos(tip - 2 * math.pi * k / ANGLES)
        weight = (4 * cosine * cosine + 2 * cosine - 1) / ANGLES  # (1 + 2 cos x + 2 cos 2x) / 5
        for part in range(2):
            for a in range(3):
                for b in range(3):
                    sums[part][node, a, b] += weight * (whole[last, k, part, a, b] - whole[first, k, part, a, b])


@inner_loop
def _add_part(
    at: tuple[int, int, int, float, float],
    part: tuple[float, float],
    slices: EdgeSlices,
    forces: EdgeForces,
    pieces: PieceNodes,
    sums: tuple[Real, Real],
    earlier: EarlierMotions,
    matrices: tuple[Real, Real],
    last: int,
) -> int:
    """Add up the force of a part of a slice; return the number of blocks in use, -1 if there is no room for another.

    ``at`` are node, tooth and slice, the spindle angle, and the immersion of the tooth's tip, rad.
    """
    (node, tooth, row, angle, tip), (low, high) = at, part
    (matrix, normal), (cutting, normals) = matrices, sums
    for q in range(len(_POINTS)):
        u = low + (high - low) * _POINTS[q]
        phi = tip - _at(slices.lags, tooth, row, u)
        sine, kappa = math.sin(phi), _between(slices.edge_angles, row, u)
        delay, chip = forces.pitches[tooth], forces.feed * forces.pitches[tooth] / (2 * math.pi) * sine
        if len(earlier.blocks):
            delay, chip = _last_pass(slices, forces, tooth, row, u, sine)
            if forces.by_offsets and chip <= 0.0:
                continue
        weight = (high - low) * _WEIGHTS[q] * slices.widths[row]
        _edge(phi, kappa, weight, _slopes(forces, chip * math.sin(kappa)), matrix, normal)
        _add(matrix, cutting, node)
        _add(normal, normals, node)
        if len(earlier.blocks):
            last = add_earlier(earlier, earlier.first[node], last, angle - delay, pieces, matrix)
            if last < 0:
                return last
    return last


@inner_loop
def _add(matrix: Real, matrices: Real, node: int) -> None:
    for a in range(3):
        for b in range(3):
            matrices[node, a, b] += matrix[a, b]


@inner_loop
def _slopes(forces: EdgeForces, chip: float) -> tuple[float, float, float]:
    """Return the change of tangential, radial and axial force per chip thickness, Pa, at a stationary chip (m)."""
    m, reference, radius = forces.exponents, forces.reference, forces.edge_radius
    return (
        forces.coefficients[0] * (1.0 - m[0]) * relative_pressure(chip, m[0], reference, radius),
        forces.coefficients[1] * (1.0 - m[1]) * relative_pressure(chip, m[1], reference, radius),
        forces.coefficients[2] * (1.0 - m[2]) * relative_pressure(chip, m[2], reference, radius),
    )


@inner_loop
def _edge(
    phi: float, kappa: float, weight: float, coefficients: tuple[float, float, float], matrix: Real, normal: Real
) -> None:
    """Write the force per motion and ``n n^T`` of a part of an edge to (3, 3) matrices."""
    sine, cosine = math.sin(phi), math.cos(phi)
    sine_edge, cosine_edge = math.sin(kappa), math.cos(kappa)
    chip = (sine * sine_edge, cosine * sine_edge, -cosine_edge)
    outward = coefficients[1] * sine_edge + coefficients[2] * cosine_edge
    force = (
        -coefficients[0] * cosine - outward * sine,
        coefficients[0] * sine - outward * cosine,
        coefficients[1] * cosine_edge - coefficients[2] * sine_edge,
    )
    for a in range(3):
        for b in range(3):
            matrix[a, b] = weight * force[a] * chip[b]
            normal[a, b] = weight * chip[a] * chip[b]
