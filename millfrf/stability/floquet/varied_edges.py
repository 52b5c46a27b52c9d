"""One period of a cut with helical edges, unequal pitch or process damping as matrices: collocation of the motion."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from millfrf.core import Complex, InputError, Real
from millfrf.cutting import MillingProcess, damping_matrices, edge_matrices

from ..milling_loop import DelaySystem
from .collocated_period import radau_nodes

MOST_NODES = 1500


@dataclass(frozen=True)
class VariedCut:
    """Motion, force and structure of one cut at collocation nodes of one period.

    With z = (Re q, Im q) at the period's beginning and Y the tool's motion at the nodes a period ago,
    ``f = a (D Y + P Y') - a R Y_before``, ``Y = E z + G f`` and ``z_next = Phi z + S f``.

    Parameters
    ----------
    monodromy : (size, size)
        Matrix that takes (z, Y) of one period to those of the next.
    force : (n_nodes * n_directions, size), N
        Matrix that gives the force at the nodes from (z, Y).
    times : (n_nodes,), s
        Times of the nodes in the period.
    weights : (n_nodes,), s
        Weights of the quadrature over the period.
    period : s
        Period that is collocated: a tooth period, or a turn where the pitch is not equal.
    directions
        Indices of the directions in which the tool moves.
    """

    monodromy: Real
    force: Real
    times: Real
    weights: Real
    period: float
    directions: NDArray[np.int64]


def period_angle(process: MillingProcess) -> float:
    """Spindle angle after which the cut repeats itself, rad: a tooth, or a turn where the pitch is not equal."""
    return 2 * np.pi / process.teeth if process.equal_pitch else 2 * np.pi


def varied_cut(system: DelaySystem, speed: float, depth: float, *, extra: int = 0) -> VariedCut:
    """Discretise one period at a spindle speed (rad/s) and a depth (m).

    Pieces run between the entries and exits of every tooth's tip and top; on each the structure is collocated at
    Radau's nodes. A tooth cuts what the one before it left at the same angle, found by polynomials of those pieces.

    Raises
    ------
    InputError
        More than 1500 nodes would be needed.
    """
    elements = _elements(system, speed, depth, extra)
    angles = np.concatenate([element.angles for element in elements])
    # a piece's last node belongs to the piece: the teeth that leave there still cut
    inner = np.concatenate([np.minimum(element.angles, element.end - 1e-10) for element in elements])
    moving = np.flatnonzero(np.abs(system.right).any(axis=0))
    pushed = np.flatnonzero(np.abs(system.left).any(axis=0))
    response = _response(system, elements, speed, moving, pushed)
    process = system.process
    teeth = depth * process.ktc * edge_matrices(process, inner, depth)[:, :, pushed][..., moving]
    flank = np.zeros((len(angles), len(pushed), len(moving)))
    if process.process_damping:
        cutting_speed = speed * process.diameter / 2
        flank = damping_matrices(process, inner, depth)[:, pushed][..., moving]
        flank = flank * (depth * process.process_damping / cutting_speed)
    now = _diagonal(teeth.sum(axis=0))
    before = np.zeros_like(now)
    for pitch, matrices in zip(process.pitches, teeth, strict=True):
        same, last = _earlier(elements, angles, pitch, period_angle(process))
        now -= _spread(matrices, same)
        before += _spread(matrices, last)
    cutting = _diagonal(-flank)
    loop = np.eye(len(now)) - now @ response.motion - cutting @ response.velocity
    drive = np.concatenate([now @ response.ring + cutting @ response.ring_velocity, -before], axis=1)
    force = np.linalg.solve(loop, drive)
    size = len(response.free)
    known = np.zeros((len(response.ring), force.shape[1]))
    known[:, :size] = response.ring
    state = np.zeros((size, force.shape[1]))
    state[:, :size] = response.free
    monodromy = np.concatenate([state + response.impulse @ force, known + response.motion @ force])
    times, weights = angles / speed, np.concatenate([element.weights for element in elements]) / speed
    return VariedCut(monodromy, force, times, weights, period_angle(process) / speed, pushed)


@dataclass(frozen=True)
class _Element:
    begin: float
    end: float
    angles: Real
    weights: Real


def _elements(system: DelaySystem, speed: float, depth: float, extra: int) -> list[_Element]:
    process = system.process
    whole = period_angle(process)
    corners = [process.start_angle, process.exit_angle]
    corners += [corner + process.lag(depth) for corner in corners]
    edges = np.mod([corner - ahead for corner in corners for ahead in process.tooth_angles], whole)
    edges = np.unique(np.concatenate([[0.0, whole], edges]))
    edges = np.append(edges[:-1][np.diff(edges) > 1e-9], whole)
    edges[0] = 0.0
    elements = []
    for begin, end in pairwise(edges):
        middle = np.array([(begin + end) / 2])
        if not edge_matrices(process, middle, depth).any():
            continue
        turn = float(np.abs(system.poles).max()) * (end - begin) / speed
        parts = max(1, int(np.ceil(turn / 24)), int(np.ceil((end - begin) / 1.6)))
        count = 9 + extra + int(np.ceil(0.62 * turn / parts + 3.5 * (end - begin) / parts))
        nodes, weights, _ = radau_nodes(count)
        for a, b in pairwise(np.linspace(begin, end, parts + 1)):
            half = (b - a) / 2
            elements.append(_Element(float(a), float(b), a + half * (nodes + 1), half * weights))
    total = sum(len(element.angles) for element in elements)
    if total > MOST_NODES:
        raise InputError(
            f"{total} nodes a period at {speed * 30 / np.pi:.4g} rpm, the most is {MOST_NODES}: the modes turn too "
            "often; leave out the highest modes, or raise the speed"
        )
    return elements


@dataclass(frozen=True)
class _Response:
    """The structure on the nodes: motion and velocity from forces there, and from the state at the beginning."""

    motion: Real
    velocity: Real
    ring: Real
    ring_velocity: Real
    impulse: Real
    free: Real


def _response(
    system: DelaySystem, elements: list[_Element], speed: float, moving: NDArray[np.int64], pushed: NDArray[np.int64]
) -> _Response:
    poles, right, left = system.poles, system.right[:, moving], system.left[:, pushed]
    sizes = np.concatenate([[0], np.cumsum([len(element.angles) for element in elements])])
    n, n_modes = int(sizes[-1]), len(poles)
    state = np.zeros((n_modes, n, n), dtype=complex)  # of each mode at the nodes from a modal force at the nodes
    impulse = np.zeros((n_modes, n), dtype=complex)  # of each mode, carried back to the beginning
    for element, start in zip(elements, sizes, strict=False):
        count = len(element.angles)
        here = slice(start, start + count)
        half = (element.end - element.begin) / speed / 2
        derivative = radau_nodes(count)[2]
        inverse = np.linalg.inv(derivative - (half * poles)[:, None, None] * np.eye(count)) * half
        state[:, here, :start] = np.exp(np.outer(poles, element.angles / speed))[:, :, None] * impulse[:, None, :start]
        state[:, here, here] = inverse
        impulse[:, here] = inverse[:, -1] * np.exp(-poles * element.end / speed)[:, None]
    times = np.concatenate([element.angles for element in elements]) / speed
    ring = np.exp(np.outer(times, poles))
    turn = np.exp(poles * period_angle(system.process) / speed)
    same = np.eye(n)
    upper = np.einsum("ij,pq->ipjq", same, system.upper[moving][:, pushed])
    motion = 2 * np.real(np.einsum("rp,rij,rq->ipjq", right, state, left)) + upper
    speeds = poles[:, None, None] * state + same
    velocity = 2 * np.real(np.einsum("rp,rij,rq->ipjq", right, speeds, left))
    size = n * len(moving), n * len(pushed)
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


def _earlier(elements: list[_Element], angles: Real, pitch: float, whole: float) -> tuple[Real, Real]:
    """Interpolation (n, n) to the angles a pitch ago: from this period's nodes and from the last one's."""
    wanted = angles - pitch
    last = wanted < -1e-9
    wanted = np.where(last, wanted + whole, wanted)
    middles = np.array([(element.begin + element.end) / 2 for element in elements])
    halves = np.array([(element.end - element.begin) / 2 for element in elements])
    nearest = np.argmin(np.abs(wanted[:, None] - middles) - halves, axis=1)
    starts = np.concatenate([[0], np.cumsum([len(element.angles) for element in elements])])
    full = np.zeros((len(angles), len(angles)))
    for k, element in enumerate(elements):
        rows = np.flatnonzero(nearest == k)
        nodes = radau_nodes(len(element.angles))[0]
        at = np.clip((wanted[rows] - middles[k]) / halves[k], -1.0, 1.0)
        full[rows, starts[k] : starts[k + 1]] = _lagrange(nodes, at)
    return full * ~last[:, None], full * last[:, None]


def _lagrange(nodes: Real, at: Real) -> Real:
    """Lagrange polynomials of the nodes at points, (n_points, n_nodes), by the barycentric formula."""
    gaps = nodes[:, None] - nodes
    np.fill_diagonal(gaps, 1.0)
    weights = 1 / np.prod(2 * gaps, axis=1)  # 2: the inverse capacity of (-1, 1), against underflow
    distance = at[:, None] - nodes
    hit = np.abs(distance) < 1e-12
    terms = weights / np.where(hit, 1.0, distance)
    values = terms / terms.sum(axis=1, keepdims=True)
    struck = hit.any(axis=1)
    values[struck] = hit[struck]
    return np.asarray(values)


def _diagonal(blocks: Real) -> Real:
    """Blocks (n, p, q) on a diagonal, (n p, n q)."""
    n, p, q = blocks.shape
    full = np.zeros((n, p, n, q))
    full[np.arange(n), :, np.arange(n)] = blocks
    return full.reshape(n * p, n * q)


def _spread(blocks: Real, weights: Real) -> Real:
    """Blocks (n, p, q) times interpolation (n, n), (n p, n q)."""
    n, p, q = blocks.shape
    return np.asarray(np.einsum("ipq,ij->ipjq", blocks, weights).reshape(n * p, n * q))
