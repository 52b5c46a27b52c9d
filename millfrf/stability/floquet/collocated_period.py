"""One period of a cut as matrices: spectral collocation, also for helical edges, unequal pitch and process damping."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np

from millfrf.core import Complex, Index, InputError, Real
from millfrf.cutting import MillingProcess, chip_direction, damping_matrices, edge_matrices, force_direction

from ..milling_loop import DelaySystem, Piece, engagement_pieces
from ..settings import SETTINGS


@dataclass(frozen=True)
class PeriodOperator:
    """Matrices that describe how the chip thickness moves the tool within one period, at several speeds.

    With the regenerated chip h at the nodes, the structure's state z = (Re q, Im q) at the beginning of the period and
    the depth a, the tool moves along the chip by ``y = E z + a G h``, and the next state is ``z_next = Phi z + a S h``.
    """

    within: Real  # G (n_speeds, n_nodes, n_nodes), nearly triangular: a chip acts only later
    motion: Real  # E (n_speeds, n_nodes, 2 n_modes): motion along the chip for a unit of each modal coordinate
    impulse: Real  # S (n_speeds, 2 n_modes, n_nodes): state at the period's end for a unit chip at each node
    free: Real  # Phi (n_speeds, 2 n_modes, 2 n_modes): transition of the structure without cutting
    times: Real  # (n_nodes,), in periods
    weights: Real  # (n_nodes,), of the quadrature over the period, in periods
    forces: Real  # (n_nodes, 3), Pa: force per unit depth and chip
    periods: Real  # (n_speeds,), s: tooth period


@cache
def radau_nodes(count: int) -> tuple[Real, Real, Real]:
    """Compute n Radau nodes in (-1, 1], quadrature weights, and the derivative matrix of functions that vanish at -1.

    The nodes are the zeros of ``P_(n-1) - P_n``, the last of them 1. They are as accurate as Chebyshev's, and the value
    at the end of a piece converges twice as fast (Hairer & Wanner, Solving ODEs II, section IV.5; Trefethen, Spectral
    Methods in MATLAB, chapter 6, for the barycentric derivative).

    Examples
    --------
    >>> nodes, weights, derivative = radau_nodes(2)
    >>> nodes.round(6).tolist(), weights.round(6).tolist(), derivative.shape
    ([-0.333333, 1.0], [1.5, 0.5], (2, 2))
    """
    legendre = np.polynomial.legendre
    series = np.zeros(count + 1)
    series[count - 1], series[count] = 1.0, -1.0
    nodes = np.sort(np.real(legendre.legroots(series)))
    for _ in range(2):  # eigenvalues are not right to the last digit; Newton's steps are
        nodes = nodes - legendre.legval(nodes, series) / legendre.legval(nodes, legendre.legder(series))
    nodes[-1] = 1.0
    lower = np.zeros(count)
    lower[count - 1] = 1.0
    # mirrored from the rule with its fixed node at -1: w = (1 - x) / (n P_(n-1)(x))^2
    weights = (1 + nodes) / (count * legendre.legval(nodes, lower)) ** 2
    weights[-1] = 2 / count**2
    points = np.concatenate([[-1.0], nodes])
    gaps = points[:, None] - points
    np.fill_diagonal(gaps, 1.0)
    # products of many small gaps would underflow, so that their logarithms are added
    logs = np.log(np.abs(gaps)).sum(axis=1)
    signs = np.sign(gaps).prod(axis=1)
    ratio = (signs[:, None] * signs) * np.exp(logs[:, None] - logs)
    derivative = ratio / gaps
    np.fill_diagonal(derivative, 0.0)
    np.fill_diagonal(derivative, -derivative.sum(axis=1))
    return nodes, weights, derivative[1:, 1:]


def piece_nodes(system: DelaySystem, periods: Real, *, extra: int = 0) -> list[tuple[Piece, int]]:
    """Divide the period into pieces, each with the number of nodes that it needs at the longest of ``periods``.

    In a piece the phase of the fastest mode advances by at most 24 rad; more advance requires more nodes.
    """
    fastest = float(np.abs(system.poles).max()) * float(periods.max()) * system.process.teeth / (2 * np.pi)
    result = []
    for whole_piece in engagement_pieces(system.process):
        turn = fastest * (whole_piece.end - whole_piece.begin)
        pieces = max(1, int(np.ceil(turn / 24)))
        count = 14 + extra + int(np.ceil(0.62 * turn / pieces))
        result += [(piece, count) for piece in whole_piece.split(pieces)]
    total = sum(count * len(piece.immersions) for piece, count in result)
    if total > SETTINGS.most_nodes:
        raise InputError(
            f"{total} nodes a tooth period at {2 * np.pi / (system.process.teeth * periods.max()):.4g} rad/s: the "
            "modes turn too often between two teeth; leave out the highest modes, or raise the speed"
        )
    return result


def period_operator(system: DelaySystem, periods: Real, *, extra: int = 0) -> PeriodOperator:
    """Discretise one tooth period at several tooth periods (n_speeds,), s, all with the nodes of the longest.

    On each piece ``v' = p v + force`` is collocated for every pole. A tooth's force has rank one, so that the unknown
    is one chip thickness per node, not the whole state, and its size does not grow with the modes. ``extra`` nodes in
    each piece show the discretisation error.
    """
    pieces = piece_nodes(system, periods, extra=extra)
    poles, n_modes = system.poles, len(system.poles)
    sizes = [count * len(piece.immersions) for piece, count in pieces]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    n = int(starts[-1])
    within = np.zeros((len(periods), n, n))
    motion = np.zeros((len(periods), n, n_modes), dtype=complex)
    impulse = np.zeros((len(periods), n_modes, n), dtype=complex)
    times, weights, forces = np.zeros(n), np.zeros(n), np.zeros((n, 3))
    pitch = 2 * np.pi / system.process.teeth
    for (piece, count), start in zip(pieces, starts, strict=False):
        block = _piece(system, periods, piece, count)
        rows = slice(start, start + count * len(piece.immersions))
        begin, end = piece.begin / pitch * periods, piece.end / pitch * periods
        times[rows], weights[rows], forces[rows] = block.times, block.weights, block.forces
        motion[:, rows] = block.decay * np.exp(np.outer(begin, poles))[:, None, :]
        # the vibration that earlier pieces caused, referred to the period's beginning, continues in this piece
        within[:, rows, :start] = 2 * np.real(motion[:, rows] @ impulse[:, :, :start])
        within[:, rows, rows] = block.within
        impulse[:, :, rows] = block.impulse * np.exp(-np.outer(end, poles))[:, :, None]
    turn = np.exp(np.outer(periods, poles))
    impulse = impulse * turn[:, :, None]
    diagonal = np.eye(n_modes)
    real, imaginary = turn.real[:, :, None] * diagonal, turn.imag[:, :, None] * diagonal
    return PeriodOperator(
        within,
        2 * np.concatenate([motion.real, -motion.imag], axis=2),
        np.concatenate([impulse.real, impulse.imag], axis=1),
        np.block([[real, -imaginary], [imaginary, real]]),
        times,
        weights,
        forces,
        periods,
    )


@dataclass(frozen=True)
class _Block:
    """Arrays of a single piece, named as in `PeriodOperator` but from the beginning to the end of the piece."""

    within: Real
    decay: Complex
    impulse: Complex
    times: Real
    weights: Real
    forces: Real


def _piece(system: DelaySystem, periods: Real, piece: Piece, count: int) -> _Block:
    nodes, weight, derivative = radau_nodes(count)
    pitch = 2 * np.pi / system.process.teeth
    share = (piece.end - piece.begin) / pitch
    half = share * periods / 2
    angles = (piece.end - piece.begin) / 2 * (nodes + 1)
    teeth = len(piece.immersions)
    immersions = np.concatenate([phi + angles for phi in piece.immersions])
    forces = system.process.ktc * force_direction(system.process, immersions)
    chips = chip_direction(system.process, immersions)
    poles = system.poles
    turning = derivative - (half[:, None] * poles)[:, :, None, None] * np.eye(count)
    inverse = np.linalg.inv(turning) * half[:, None, None, None]  # (n_speeds, n_modes, count, count)
    modal_force = np.einsum("rd,nd->rn", system.left, forces)  # per chip at each node
    modal_chip = np.einsum("nd,rd->nr", chips, system.right)  # at each node per modal coordinate
    chip_by_tooth, force_by_tooth = modal_chip.reshape(teeth, count, -1), modal_force.reshape(-1, teeth, count)
    within = 2 * np.real(
        np.einsum("tir,srij,ruj->stiuj", chip_by_tooth, inverse, force_by_tooth, optimize=True)
    ).reshape(len(periods), teeth * count, teeth * count)
    if system.upper.any():
        same_instant = np.tile(np.eye(count), (teeth, teeth))
        within = within + same_instant * (chips @ system.upper @ forces.T)
    ring = np.exp(half[:, None, None] * (nodes + 1)[:, None] * poles)
    decay = modal_chip * np.tile(ring, (1, teeth, 1))
    impulse = np.tile(inverse[:, :, -1, :], (1, 1, teeth)) * modal_force
    times = np.tile(piece.begin / pitch + share / 2 * (nodes + 1), teeth)
    return _Block(within, decay, impulse, times, np.tile(weight * share / 2, teeth), forces)


@dataclass(frozen=True)
class LoopGain:
    """The operator that has the eigenvalue 1 / depth if a cut is on the boundary of stability.

    A motion that is multiplied by ``mu = exp(i theta)`` each tooth period has ``h = (1 - 1 / mu) y`` and
    ``z = (mu - Phi)^-1 a S h``. Inserted into ``y = E z + a G h`` this is

    ``h / a = (1 - 1 / mu) [G + E (mu - Phi)^-1 S] h``.

    All depths at which a multiplier is on the unit circle are reciprocal eigenvalues for theta in (0, pi]; no grid of
    depths is needed. The method is the zero-order solution with coefficients that vary over the period.
    """

    operator: PeriodOperator

    def eigenvalues(self, speeds: Index, theta: Real) -> Complex:
        """Compute eigenvalues, largest first, for pairs of speed index and theta, (n_pairs, n), 1/m."""
        multiplier = np.exp(1j * theta)[:, None, None]
        size = self.operator.free.shape[-1]
        carried = np.linalg.solve(multiplier * np.eye(size) - self.operator.free[speeds], self.operator.impulse[speeds])
        gain = (1 - 1 / multiplier) * (self.operator.within[speeds] + self.operator.motion[speeds] @ carried)
        return largest_first(np.linalg.eigvals(gain))


def largest_first(values: Complex) -> Complex:
    """Sort eigenvalues (n, size) in each row by falling modulus."""
    return np.asarray(np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1))


@dataclass(frozen=True)
class VariedCut:
    """Motion, force and structure of one cut at the collocation nodes of one period.

    With the state z = (Re q, Im q) at the beginning of the period, the tool's motion Y at the nodes and Y_before one
    period earlier: ``f = a (D Y + P Y') - a R Y_before``, ``Y = E z + G f`` and ``z_next = Phi z + S f``.
    """

    monodromy: Real  # (size, size): maps (z, Y) of one period to those of the next
    force: Real  # (n_nodes * n_directions, size), N: force at the nodes from (z, Y)
    times: Real  # (n_nodes,), s
    weights: Real  # (n_nodes,), s, of the quadrature over the period
    period: float  # s: a tooth period, or a turn where the pitch is not equal
    directions: Index  # in which a force moves the tool


def period_angle(process: MillingProcess) -> float:
    """Return the spindle angle (rad) after which the cut repeats: one tooth, or one revolution at unequal pitch."""
    return 2 * np.pi / process.teeth if process.equal_pitch else 2 * np.pi


def varied_cut(system: DelaySystem, speed: float, depth: float, *, extra: int = 0) -> VariedCut:
    """Discretise one period at a spindle speed (rad/s) and a depth (m).

    Pieces end where the tip or the top of an edge enters or leaves the cut. In each piece the structure is collocated
    at Radau's nodes. A tooth cuts the surface that the tooth before left at the same angle; the polynomials of the
    earlier pieces give this surface.
    """
    elements = _elements(system, speed, depth, extra)
    angles = np.concatenate([element.angles for element in elements])
    # the last node belongs to its piece: the teeth that leave the cut there still cut
    inner = np.concatenate([np.minimum(element.angles, element.end - 1e-10) for element in elements])
    moving = np.flatnonzero(np.abs(system.right).any(axis=0))
    forced = np.flatnonzero(np.abs(system.left).any(axis=0))
    response = _response(system, elements, speed, moving, forced)
    process = system.process
    teeth = depth * process.ktc * edge_matrices(process, inner, depth)[:, :, forced][..., moving]
    flank = np.zeros((len(angles), len(forced), len(moving)))
    if process.process_damping:
        cutting_speed = speed * process.diameter / 2
        flank = damping_matrices(process, inner, depth)[:, forced][..., moving]
        flank = flank * (depth * process.process_damping / cutting_speed)
    now = _diagonal(teeth.sum(axis=0))
    before = np.zeros_like(now)
    for pitch, matrices in zip(process.pitches, teeth, strict=True):
        current, previous = _earlier(elements, angles, pitch, period_angle(process))
        now -= _spread(matrices, current)
        before += _spread(matrices, previous)
    cutting = _diagonal(-flank)
    loop = np.eye(len(now)) - now @ response.motion - cutting @ response.velocity
    drive = np.concatenate([now @ response.ring + cutting @ response.ring_velocity, -before], axis=1)
    force = np.linalg.solve(loop, drive)
    size = len(response.free)
    motion = np.zeros((len(response.ring), force.shape[1]))
    motion[:, :size] = response.ring
    state = np.zeros((size, force.shape[1]))
    state[:, :size] = response.free
    monodromy = np.concatenate([state + response.impulse @ force, motion + response.motion @ force])
    times, weights = angles / speed, np.concatenate([element.weights for element in elements]) / speed
    return VariedCut(monodromy, force, times, weights, period_angle(process) / speed, forced)


@dataclass(frozen=True)
class _Element:
    begin: float
    end: float
    angles: Real
    weights: Real


def _elements(system: DelaySystem, speed: float, depth: float, extra: int) -> list[_Element]:
    process = system.process
    full_turn = period_angle(process)
    corners = [process.start_angle, process.exit_angle]
    corners += [corner + process.lag(depth) for corner in corners]
    edges = np.mod([corner - ahead for corner in corners for ahead in process.tooth_angles], full_turn)
    edges = np.unique(np.concatenate([[0.0, full_turn], edges]))
    edges = np.append(edges[:-1][np.diff(edges) > 1e-9], full_turn)
    edges[0] = 0.0
    elements = []
    for begin, end in pairwise(edges):
        middle = np.array([(begin + end) / 2])
        if not edge_matrices(process, middle, depth).any():
            continue
        turn = float(np.abs(system.poles).max()) * (end - begin) / speed
        pieces = max(1, int(np.ceil(turn / 24)), int(np.ceil((end - begin) / 1.6)))
        count = 9 + extra + int(np.ceil(0.62 * turn / pieces + 3.5 * (end - begin) / pieces))
        nodes, weights, _ = radau_nodes(count)
        for a, b in pairwise(np.linspace(begin, end, pieces + 1)):
            half = (b - a) / 2
            elements.append(_Element(float(a), float(b), a + half * (nodes + 1), half * weights))
    total = sum(len(element.angles) for element in elements)
    if total > SETTINGS.most_varied_nodes:
        raise InputError(
            f"{total} nodes a period at {speed * 30 / np.pi:.4g} rpm, the most is "
            f"{SETTINGS.most_varied_nodes}: the modes turn too often; leave out the highest modes, or raise the speed"
        )
    return elements


@dataclass(frozen=True)
class _Response:
    """Response of the structure at the nodes."""

    motion: Real  # from forces at the nodes
    velocity: Real
    ring: Real  # motion from the state at the beginning
    ring_velocity: Real
    impulse: Real  # state at the end from forces at the nodes
    free: Real  # state at the end from that at the beginning


def _response(system: DelaySystem, elements: list[_Element], speed: float, moving: Index, forced: Index) -> _Response:
    poles, right, left = system.poles, system.right[:, moving], system.left[:, forced]
    sizes = np.concatenate([[0], np.cumsum([len(element.angles) for element in elements])])
    n, n_modes = int(sizes[-1]), len(poles)
    state = np.zeros((n_modes, n, n), dtype=complex)  # of each mode at the nodes from a modal force at the nodes
    impulse = np.zeros((n_modes, n), dtype=complex)  # of each mode, referred to the beginning
    for element, start in zip(elements, sizes, strict=False):
        count = len(element.angles)
        rows = slice(start, start + count)
        half = (element.end - element.begin) / speed / 2
        derivative = radau_nodes(count)[2]
        inverse = np.linalg.inv(derivative - (half * poles)[:, None, None] * np.eye(count)) * half
        state[:, rows, :start] = np.exp(np.outer(poles, element.angles / speed))[:, :, None] * impulse[:, None, :start]
        state[:, rows, rows] = inverse
        impulse[:, rows] = inverse[:, -1] * np.exp(-poles * element.end / speed)[:, None]
    times = np.concatenate([element.angles for element in elements]) / speed
    ring = np.exp(np.outer(times, poles))
    turn = np.exp(poles * period_angle(system.process) / speed)
    identity = np.eye(n)
    upper = np.einsum("ij,pq->ipjq", identity, system.upper[moving][:, forced])
    motion = 2 * np.real(np.einsum("rp,rij,rq->ipjq", right, state, left)) + upper
    speeds = poles[:, None, None] * state + identity
    velocity = 2 * np.real(np.einsum("rp,rij,rq->ipjq", right, speeds, left))
    size = n * len(moving), n * len(forced)
    carried = np.einsum("rj,rq->rjq", impulse * turn[:, None], left).reshape(n_modes, -1)
    rotation = np.block([[np.diag(turn.real), -np.diag(turn.imag)], [np.diag(turn.imag), np.diag(turn.real)]])
    return _Response(
        motion.reshape(size),
        velocity.reshape(size),
        _real_columns(np.einsum("ir,rp->ipr", ring, right).reshape(size[0], n_modes)),
        _real_columns(np.einsum("ir,rp->ipr", ring * poles, right).reshape(size[0], n_modes)),
        np.concatenate([carried.real, carried.imag]),
        rotation,
    )


def _real_columns(columns: Complex) -> Real:
    return np.asarray(2 * np.concatenate([columns.real, -columns.imag], axis=1))


def _earlier(elements: list[_Element], angles: Real, pitch: float, full_turn: float) -> tuple[Real, Real]:
    """Compute two interpolations (n, n) to the angles one pitch ago: from nodes of this and of the previous period."""
    earlier = angles - pitch
    previous = earlier < -1e-9
    earlier = np.where(previous, earlier + full_turn, earlier)
    middles = np.array([(element.begin + element.end) / 2 for element in elements])
    halves = np.array([(element.end - element.begin) / 2 for element in elements])
    nearest = np.argmin(np.abs(earlier[:, None] - middles) - halves, axis=1)
    starts = np.concatenate([[0], np.cumsum([len(element.angles) for element in elements])])
    full = np.zeros((len(angles), len(angles)))
    for k, element in enumerate(elements):
        rows = np.flatnonzero(nearest == k)
        nodes = radau_nodes(len(element.angles))[0]
        at = np.clip((earlier[rows] - middles[k]) / halves[k], -1.0, 1.0)
        full[rows, starts[k] : starts[k + 1]] = _lagrange(nodes, at)
    return full * ~previous[:, None], full * previous[:, None]


def _lagrange(nodes: Real, at: Real) -> Real:
    """Evaluate the Lagrange polynomials of the nodes at points, (n_points, n_nodes), by the barycentric formula."""
    gaps = nodes[:, None] - nodes
    np.fill_diagonal(gaps, 1.0)
    weights = 1 / np.prod(2 * gaps, axis=1)  # 2: the inverse capacity of (-1, 1), against underflow
    distance = at[:, None] - nodes
    hit = np.abs(distance) < 1e-12
    terms = weights / np.where(hit, 1.0, distance)
    values = terms / terms.sum(axis=1, keepdims=True)
    at_node = hit.any(axis=1)
    values[at_node] = hit[at_node]
    return np.asarray(values)


def _diagonal(blocks: Real) -> Real:
    """Place n blocks (p, q) on the diagonal of a matrix, (n p, n q)."""
    n, p, q = blocks.shape
    full = np.zeros((n, p, n, q))
    full[np.arange(n), :, np.arange(n)] = blocks
    return full.reshape(n * p, n * q)


def _spread(blocks: Real, weights: Real) -> Real:
    """Multiply n blocks (p, q) by interpolation weights (n, n) into a matrix, (n p, n q)."""
    n, p, q = blocks.shape
    return np.asarray(np.einsum("ipq,ij->ipjq", blocks, weights).reshape(n * p, n * q))
