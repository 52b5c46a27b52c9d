"""`Structure`: nodes, springs, beams, rigid links and bodies at one posture, and their matrices."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import Real

from .beam_element import Section, beam_mass, beam_stiffness


@dataclass(frozen=True)
class Spring:
    """A joint's compliance between two nodes (Belchior et al. 2013, Eqs. 6-8).

    It acts at its own place; where a node stands elsewhere (several joints may share it), a rigid arm carries it there.

    Parameters
    ----------
    nodes
        Node on the body before the joint, and node on the body after it.
    axes : (3, 3)
        Joint frame as columns in the base frame, with z along the joint's axis.
    stiffness : (6,)
        Stiffnesses ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)``: radial and axial, N/m, then rotational, N m/rad; infinite:
        rigid.
    place : (3,), m
        Position of the joint in the base frame.
    """

    nodes: tuple[int, int]
    axes: Real
    stiffness: Real
    place: Real

    def motions(self, positions: Real) -> tuple[Real, Real]:
        """Motion at the joint, in its axes, over that of its first and of its second node, each (6, 6).

        ``R^T (t + theta x (place - p); theta)``: the joint's relative displacement is the second's minus the first's.
        """
        turn = six_by_six(self.axes).T
        first, second = (turn @ rigid_motion(self.place - positions[node]) for node in self.nodes)
        return first, second


@dataclass(frozen=True)
class Drive:
    """A motor's rotor between the body before a joint and its gear, as a node of its own.

    Parameters
    ----------
    servo
        The controller's hold on it, from the node before the joint to the rotor's: rigid but for ``direction``.
    direction
        The joint's own motion: 5, about z, or 2, along z.
    inertia : kg m^2 or kg
        ``N^2 J`` on the joint's side. Only the rotor's own turning counts (Spong 1987, ASME J. Dyn. Syst. 109,
        310-319: what is left out is smaller by the gear ratio); its mass belongs to the body that carries it.
    """

    servo: Spring
    direction: int
    inertia: float


@dataclass(frozen=True)
class Beam:
    """A flexible link from one node to another; ``axes`` (3, 3) has its local x, y, z as columns."""

    nodes: tuple[int, int]
    axes: Real
    section: Section


@dataclass(frozen=True)
class Body:
    """A rigid body that moves with a node: mass, kg, centre from the node, m, inertia about the centre, kg m^2.

    ``centre`` (3,) and ``inertia`` (3, 3) are in the base frame.
    """

    node: int
    mass: float
    centre: Real
    inertia: Real


@dataclass(frozen=True)
class Structure:
    """A robot's elastic structure at one posture; node 0 is clamped.

    Parameters
    ----------
    positions : (n_nodes, 3), m
        Positions of the nodes in the base frame.
    springs, beams, bodies
        Springs of the joints, beams of the links, and bodies with mass.
    rigid
        Pairs of nodes that a rigid link joins.
    tip
        Number of the node of the tool tip.
    weight : (6 n_nodes, 6 n_nodes) or None
        Stiffness by the weight that the joints carry; None: left out.
    drives
        Rotors of the joints' motors. The spring of a joint with a drive begins at its rotor's node.
    """

    positions: Real
    springs: tuple[Spring, ...]
    beams: tuple[Beam, ...]
    rigid: tuple[tuple[int, int], ...]
    bodies: tuple[Body, ...]
    tip: int
    weight: Real | None = None
    drives: tuple[Drive, ...] = ()

    @property
    def couplings(self) -> tuple[Spring, ...]:
        """Springs of joints, and the controller's hold on their motors."""
        return (*self.springs, *(drive.servo for drive in self.drives))


def stiffness_matrix(structure: Structure) -> Real:
    """Stiffness over all nodes before the clamp, shape (6 H, 6 H); rigid directions of joints are left out."""
    size = 6 * len(structure.positions)
    whole = np.zeros((size, size)) if structure.weight is None else structure.weight.copy()
    for spring in structure.couplings:
        elastic = np.where(np.isfinite(spring.stiffness), spring.stiffness, 0.0)
        before, after = spring.motions(structure.positions)
        first, second = (slice(6 * node, 6 * node + 6) for node in spring.nodes)
        whole[first, first] += (before.T * elastic) @ before
        whole[second, second] += (after.T * elastic) @ after
        whole[first, second] -= (before.T * elastic) @ after
        whole[second, first] -= (after.T * elastic) @ before
    for beam, length in _lengths(structure):
        _add(whole, beam.nodes, _turned(beam_stiffness(beam.section, length), beam.axes))
    return whole


def mass_matrix(structure: Structure) -> Real:
    """Consistent mass of beams, and bodies, over all nodes, shape (6 H, 6 H)."""
    size = 6 * len(structure.positions)
    whole = np.zeros((size, size))
    for beam, length in _lengths(structure):
        _add(whole, beam.nodes, _turned(beam_mass(beam.section, length), beam.axes))
    for body in structure.bodies:
        shift = np.eye(6)
        shift[:3, 3:] = -cross_matrix(body.centre)
        own = np.zeros((6, 6))
        own[:3, :3] = body.mass * np.eye(3)
        own[3:, 3:] = body.inertia
        start = 6 * body.node
        whole[start : start + 6, start : start + 6] += shift.T @ own @ shift
    for drive in structure.drives:
        row = _own_motion(drive, structure)
        whole += drive.inertia * np.outer(row, row)
    return whole


def _own_motion(drive: Drive, structure: Structure) -> Real:
    """Turn of a rotor against the body that carries it, over all nodes, (6 H,)."""
    row = np.zeros(6 * len(structure.positions))
    for node, sign, motion in zip(drive.servo.nodes, (-1, 1), drive.servo.motions(structure.positions), strict=True):
        row[6 * node : 6 * node + 6] += sign * motion[drive.direction]
    return row


def rigid_rows(structure: Structure) -> Real:
    """Rows of ``A x = 0``: rigid links, then rigid directions of joints; shape (n_rows, 6 H).

    ``delta_v - delta_u - theta_u x r = 0`` and ``theta_v - theta_u = 0`` (Belchior et al. 2013, Eq. 12).
    """
    size = 6 * len(structure.positions)
    rows = []
    for u, v in structure.rigid:
        block = np.zeros((6, size))
        block[:, 6 * v : 6 * v + 6] = np.eye(6)
        block[:, 6 * u : 6 * u + 6] = -rigid_motion(structure.positions[v] - structure.positions[u])
        rows.append(block)
    for spring in structure.couplings:
        stiff = np.isinf(spring.stiffness)
        if stiff.any():
            block = np.zeros((int(stiff.sum()), size))
            before, after = spring.motions(structure.positions)
            first, second = spring.nodes
            block[:, 6 * second : 6 * second + 6] = after[stiff]
            block[:, 6 * first : 6 * first + 6] = -before[stiff]
            rows.append(block)
    return np.vstack(rows) if rows else np.zeros((0, size))


def rigid_motion(arm: Real) -> Real:
    """Motion (6,) of a point at ``arm`` (3,) from a node of the same rigid body, over the node's; shape (6, 6)."""
    motion = np.eye(6)
    motion[:3, 3:] = -cross_matrix(arm)
    return motion


def cross_matrix(vector: Real) -> Real:
    """The matrix that takes x to ``vector x x``, shape (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def six_by_six(axes: Real) -> Real:
    """Axes (3, 3) for translations and rotations together, shape (6, 6)."""
    whole = np.zeros((6, 6))
    whole[:3, :3] = whole[3:, 3:] = axes
    return whole


def _lengths(structure: Structure) -> Iterable[tuple[Beam, float]]:
    for beam in structure.beams:
        first, second = beam.nodes
        arm = structure.positions[second] - structure.positions[first]
        yield beam, round(float(np.sqrt(arm @ arm)), 12)  # the same length in every posture: its matrices are kept


def _turned(local: Real, axes: Real) -> Real:
    """``B K B^T`` with the axes on the diagonal (Belchior et al. 2013, Eqs. 10-11)."""
    turn = np.zeros((12, 12))
    for start in range(0, 12, 3):
        turn[start : start + 3, start : start + 3] = axes
    return np.asarray(turn @ local @ turn.T)


def _add(whole: Real, nodes: tuple[int, int], block: Real) -> None:
    first, second = 6 * nodes[0], 6 * nodes[1]
    whole[first : first + 6, first : first + 6] += block[:6, :6]
    whole[first : first + 6, second : second + 6] += block[:6, 6:]
    whole[second : second + 6, first : first + 6] += block[6:, :6]
    whole[second : second + 6, second : second + 6] += block[6:, 6:]


def coordinate_basis(structure: Structure) -> Real:
    """Displacement of all nodes over independent coordinates, ``x = T q``, shape (6 H, n); node 0 is clamped.

    Nodes are reached from the base: over a rigid link a node follows, over a joint it adds the joint's elastic
    directions, over a beam it adds six coordinates. Where a loop of constraints closes, T is narrowed to the null space
    of what is left. ``T^T K T`` is positive definite where the saddle system is invertible.
    """
    n_nodes = len(structure.positions)
    motion: dict[int, list[tuple[slice, Real]]] = {0: []}
    width = 0
    while len(motion) < n_nodes:
        node, terms, added = _next_node(structure, motion, width)
        motion[node] = terms
        width += added
    basis = np.zeros((6 * n_nodes, width))
    for node, terms in motion.items():
        for columns, block in terms:
            basis[6 * node : 6 * node + 6, columns] += block
    left = rigid_rows(structure) @ basis
    if np.abs(left).max(initial=0.0) > 1e-9:
        basis = basis @ scipy.linalg.null_space(left, rcond=1e-10)
    return basis


_Motion = dict[int, list[tuple[slice, Real]]]


def _next_node(structure: Structure, motion: _Motion, width: int) -> tuple[int, list[tuple[slice, Real]], int]:
    """A node that follows from one already reached: rigid links first, then joints, then beams."""
    for u, v in structure.rigid:
        for known, new in ((u, v), (v, u)):
            if known in motion and new not in motion:
                shift = rigid_motion(structure.positions[new] - structure.positions[known])
                return new, [(columns, shift @ block) for columns, block in motion[known]], 0
    for spring in structure.couplings:
        first, second = spring.nodes
        for known, new in ((first, second), (second, first)):
            if known in motion and new not in motion and np.isinf(spring.stiffness).any():
                elastic = _elastic_directions(spring, structure.positions[new])
                shift = rigid_motion(structure.positions[new] - structure.positions[known])
                carried = [(columns, shift @ block) for columns, block in motion[known]]
                return new, [*carried, (slice(width, width + elastic.shape[1]), elastic)], elastic.shape[1]
    free = next(node for node in range(len(structure.positions)) if node not in motion)
    return free, [(slice(width, width + 6), np.eye(6))], 6


def _elastic_directions(spring: Spring, position: Real) -> Real:
    """Motion of a node at ``position`` over the joint's elastic directions, shape (6, n_elastic)."""
    directions = six_by_six(spring.axes)[:, np.isfinite(spring.stiffness)]
    return np.asarray(rigid_motion(position - spring.place) @ directions)
