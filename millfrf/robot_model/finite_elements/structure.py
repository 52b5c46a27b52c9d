"""`Structure`: nodes, springs, beams, rigid links and bodies in one posture, their matrices, and reduction to modes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import InputError, Real
from modal_fit import ModalModel, Residuals

from .beam_element import Section, beam_mass, beam_stiffness


@dataclass(frozen=True)
class Spring:
    """Compliance of a joint between a node on the body before it and a node on the body after it.

    The spring acts at its own place; if a node stands elsewhere (several joints may share it), a rigid arm connects
    them (Belchior et al. 2013, Eqs. 6-8).
    """

    nodes: tuple[int, int]
    axes: Real  # (3, 3), joint frame as columns in the base frame, z along the joint's axis
    stiffness: Real  # (6,): (K_r, K_r, K_a, K_rr, K_rr, K_ar), N/m and N m/rad; infinite: rigid
    place: Real  # (3,), m, in the base frame

    def motions(self, positions: Real) -> tuple[Real, Real]:
        """Return two matrices (6, 6): from the motion of the first and of the second node to motion at the joint.

        Motion at the joint is in the joint's axes R: ``R^T (t + theta x (place - p); theta)`` for a node at p. The
        relative motion in the joint is the second motion minus the first.
        """
        turn = six_by_six(self.axes).T
        first, second = (turn @ rigid_motion(self.place - positions[node]) for node in self.nodes)
        return first, second

    def relative_motion(self, positions: Real) -> Real:
        """Return the matrix (6, 6 n_nodes) from the motion of all nodes to the relative motion in the joint's axes."""
        before, after = self.motions(positions)
        rows = np.zeros((6, 6 * len(positions)))
        rows[:, _dofs(self.nodes[1])] = after
        rows[:, _dofs(self.nodes[0])] = -before
        return rows


@dataclass(frozen=True)
class Drive:
    """Rotor of a motor as a separate node between the body before a joint and the joint's gear.

    Only the rotation of the rotor about its axis is modelled (Spong 1987, ASME J. Dyn. Syst. 109, 310-319: all further
    terms are smaller by the gear ratio). The mass of the rotor belongs to the body that carries the motor.
    """

    servo: Spring  # stiffness of the controller, from the node before the joint to the rotor: rigid but for `direction`
    direction: int  # the joint's own motion: 5, about z, or 2, along z
    inertia: float  # N^2 J on the joint's side, kg m^2 or kg


@dataclass(frozen=True)
class Beam:
    """A flexible link from one node to another; ``axes`` (3, 3) has its local x, y, z as columns."""

    nodes: tuple[int, int]
    axes: Real
    section: Section


@dataclass(frozen=True)
class Body:
    """A rigid body that moves with a node; centre and inertia are in the base frame."""

    node: int
    mass: float  # kg
    centre: Real  # (3,), m, from the node
    inertia: Real  # (3, 3), kg m^2, about the centre


@dataclass(frozen=True)
class Structure:
    """The elastic structure of a robot in one posture; node 0 is clamped."""

    positions: Real  # (n_nodes, 3), m, in the base frame
    springs: tuple[Spring, ...]  # the spring of a joint with a drive begins at the rotor's node
    beams: tuple[Beam, ...]
    rigid: tuple[tuple[int, int], ...]  # pairs of nodes that a rigid link joins
    bodies: tuple[Body, ...]
    tip: int  # node of the tool tip
    weight: Real | None = None  # (6 n_nodes, 6 n_nodes), stiffness by the weight that the joints carry
    drives: tuple[Drive, ...] = ()

    @property
    def couplings(self) -> tuple[Spring, ...]:
        """Return the springs of all joints and the springs by which controllers hold the motors."""
        return (*self.springs, *(drive.servo for drive in self.drives))


def stiffness_matrix(structure: Structure) -> Real:
    """Assemble the stiffness over all nodes, node 0 not yet clamped, (6 n_nodes, 6 n_nodes).

    Rigid directions of joints are left out: they are constraints.
    """
    size = 6 * len(structure.positions)
    stiffness = np.zeros((size, size)) if structure.weight is None else structure.weight.copy()
    for spring in structure.couplings:
        elastic = np.where(np.isfinite(spring.stiffness), spring.stiffness, 0.0)
        before, after = spring.motions(structure.positions)
        first, second = (_dofs(node) for node in spring.nodes)
        stiffness[first, first] += (before.T * elastic) @ before
        stiffness[second, second] += (after.T * elastic) @ after
        stiffness[first, second] -= (before.T * elastic) @ after
        stiffness[second, first] -= (after.T * elastic) @ before
    for beam, length in _lengths(structure):
        _add_beam(stiffness, beam, beam_stiffness(beam.section, length))
    return stiffness


def mass_matrix(structure: Structure) -> Real:
    """Assemble the mass of beams (consistent), bodies and rotors over all nodes, (6 n_nodes, 6 n_nodes)."""
    size = 6 * len(structure.positions)
    mass = np.zeros((size, size))
    for beam, length in _lengths(structure):
        _add_beam(mass, beam, beam_mass(beam.section, length))
    for body in structure.bodies:
        shift = rigid_motion(body.centre)
        own = np.zeros((6, 6))
        own[:3, :3] = body.mass * np.eye(3)
        own[3:, 3:] = body.inertia
        mass[_dofs(body.node), _dofs(body.node)] += shift.T @ own @ shift
    for drive in structure.drives:
        row = drive.servo.relative_motion(structure.positions)[drive.direction]
        mass += drive.inertia * np.outer(row, row)
    return mass


def rigid_rows(structure: Structure) -> Real:
    """Build the constraint matrix A of ``A x = 0``, (n_rows, 6 n_nodes): rigid links, then rigid directions of joints.

    A rigid link from node u to node v has ``delta_v - delta_u - theta_u x r = 0`` and ``theta_v - theta_u = 0``
    (Belchior et al. 2013, Eq. 12).
    """
    size = 6 * len(structure.positions)
    rows = [np.zeros((0, size))]
    for u, v in structure.rigid:
        block = np.zeros((6, size))
        block[:, _dofs(v)] = np.eye(6)
        block[:, _dofs(u)] = -rigid_motion(structure.positions[v] - structure.positions[u])
        rows.append(block)
    for spring in structure.couplings:
        stiff = np.isinf(spring.stiffness)
        if stiff.any():
            rows.append(spring.relative_motion(structure.positions)[stiff])
    return np.vstack(rows)


def rigid_motion(arm: Real) -> Real:
    """Return the matrix (6, 6) from the motion of a node to that of a point at ``arm`` (3,) on the same rigid body."""
    motion = np.eye(6)
    motion[:3, 3:] = -cross_matrix(arm)
    return motion


def cross_matrix(vector: Real) -> Real:
    """Return the matrix (3, 3) that multiplies a column as the cross product ``vector x column`` does."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def six_by_six(axes: Real) -> Real:
    """Repeat axes (3, 3) on the diagonal, (6, 6), for translations and rotations."""
    blocks = np.zeros((6, 6))
    blocks[:3, :3] = blocks[3:, 3:] = axes
    return blocks


def _dofs(node: int) -> slice:
    return slice(6 * node, 6 * node + 6)


def _lengths(structure: Structure) -> Iterable[tuple[Beam, float]]:
    for beam in structure.beams:
        first, second = beam.nodes
        arm = structure.positions[second] - structure.positions[first]
        # rounding gives the same length in every posture, so that the cached matrices of the beam are used
        yield beam, round(float(np.sqrt(arm @ arm)), 12)


def _add_beam(matrix: Real, beam: Beam, local: Real) -> None:
    """Add a beam's ``local`` matrix K as ``B K B^T``, its axes on the diagonal of B (Belchior et al., Eqs. 10-11)."""
    turn = np.zeros((12, 12))
    for start in range(0, 12, 3):
        turn[start : start + 3, start : start + 3] = beam.axes
    first, second = (_dofs(node) for node in beam.nodes)
    block = turn @ local @ turn.T
    matrix[first, first] += block[:6, :6]
    matrix[first, second] += block[:6, 6:]
    matrix[second, first] += block[6:, :6]
    matrix[second, second] += block[6:, 6:]


def coordinate_basis(structure: Structure) -> Real:
    """Compute the matrix T (6 n_nodes, n) from independent coordinates q to all nodes, ``x = T q``; node 0 is clamped.

    Nodes are visited from the base. A node on a rigid link follows the visited node and adds no coordinate. A node
    after a joint with rigid directions adds the joint's elastic directions as coordinates. Any other node adds six. If
    constraints form a loop, T is restricted to the null space of the remaining constraints. ``T^T K T`` is positive
    definite if the system of :func:`constrained_system` is invertible.
    """
    n_nodes = len(structure.positions)
    motion: _Motion = {0: []}
    width = 0
    while len(motion) < n_nodes:
        node, terms, added = _next_node(structure, motion, width)
        motion[node] = terms
        width += added
    basis = np.zeros((6 * n_nodes, width))
    for node, terms in motion.items():
        for columns, block in terms:
            basis[_dofs(node), columns] += block
    open_constraints = rigid_rows(structure) @ basis
    if np.abs(open_constraints).max(initial=0.0) > 1e-9:  # more than rounding: a closed loop
        basis = basis @ scipy.linalg.null_space(open_constraints, rcond=1e-10)
    return basis


_Motion = dict[int, list[tuple[slice, Real]]]  # blocks of T for each node that is reached


def _next_node(structure: Structure, motion: _Motion, width: int) -> tuple[int, list[tuple[slice, Real]], int]:
    """Choose the next node to visit; return it, its blocks of T, and the number of coordinates that it adds.

    Nodes behind rigid links come first, nodes behind joints with rigid directions second: they add fewest coordinates.
    """
    for u, v in structure.rigid:
        for known, new in ((u, v), (v, u)):
            if known in motion and new not in motion:
                return new, _follow(structure, motion, known, new), 0
    for spring in structure.couplings:
        first, second = spring.nodes
        for known, new in ((first, second), (second, first)):
            if known in motion and new not in motion and np.isinf(spring.stiffness).any():
                directions = six_by_six(spring.axes)[:, np.isfinite(spring.stiffness)]
                elastic = np.asarray(rigid_motion(structure.positions[new] - spring.place) @ directions)
                count = elastic.shape[1]
                follow = _follow(structure, motion, known, new)
                return new, [*follow, (slice(width, width + count), elastic)], count
    free = next(node for node in range(len(structure.positions)) if node not in motion)
    return free, [(slice(width, width + 6), np.eye(6))], 6


def _follow(structure: Structure, motion: _Motion, known: int, new: int) -> list[tuple[slice, Real]]:
    shift = rigid_motion(structure.positions[new] - structure.positions[known])
    return [(columns, shift @ block) for columns, block in motion[known]]


def undamped_frequencies(mass: Real, stiffness: Real) -> Real:
    """Undamped natural frequencies, Hz, (n,), rising."""
    return np.asarray(np.sqrt(scipy.linalg.eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi))


def _modes(mass: Real, stiffness: Real) -> tuple[Real, Real]:
    """Compute ``omega^2`` (n,), rising, and mass-normalised shapes (n, n); refuse a structure that can move freely."""
    squares, shapes = scipy.linalg.eigh(stiffness, mass)
    if squares[0] <= 0:
        raise InputError(f"the structure is not held: lowest omega^2 = {squares[0]:.3g}; check stiffness and posture")
    return squares, shapes


def modal_damping_matrix(mass: Real, stiffness: Real, ratios: Real) -> Real:
    """Compute ``C = M Phi diag(2 zeta_n omega_n) Phi^T M`` with ``Phi^T M Phi = I``, N s/m.

    ``ratios`` (n,) are the damping ratios of the modes in rising frequency (Clough & Penzien, Dynamics of Structures,
    section 12-5; Chen et al. 2026, Eq. 20).
    """
    ratios = np.asarray(ratios, dtype=float)
    if ratios.shape != (len(mass),):
        raise InputError(f"{ratios.size} damping ratios for {len(mass)} modes; give one for each mode")
    squares, shapes = _modes(mass, stiffness)
    weighted = mass @ shapes
    return np.asarray((weighted * (2 * ratios * np.sqrt(squares))) @ weighted.T)


def rayleigh_constants(frequencies: tuple[float, float], ratios: tuple[float, float]) -> tuple[float, float]:
    """Compute a (1/s) and b (s) of ``C = a M + b K`` from two damping ratios at two frequencies (Hz).

    ``zeta = (a / w + b w) / 2`` (Mousavi et al., Eqs. 9-11; their Eq. 11 as printed has a and b exchanged).

    Examples
    --------
    >>> [float(f"{c:.5g}") for c in rayleigh_constants((5.9, 8.2), (0.065, 0.065))]
    [2.8027, 0.0014674]
    """
    low, high = 2 * np.pi * np.asarray(frequencies, dtype=float)
    if not (low > 0 and high > 0 and low != high):
        raise InputError(f"Rayleigh damping needs two different positive frequencies, not {frequencies}")
    a, b = np.linalg.solve([[0.5 / low, 0.5 * low], [0.5 / high, 0.5 * high]], np.asarray(ratios, dtype=float))
    return float(a), float(b)


def modal_model(
    mass: Real,
    damping: Real,
    stiffness: Real,
    observed: Real,
    labels: Sequence[str],
    highest_frequency: float = np.inf,
) -> ModalModel:
    """Reduce ``M x'' + C x' + K x = S^T f``, ``y = S x`` to a modal model.

    If the modes of M and K diagonalise C (modal or Rayleigh damping), they are real:
    ``phi phi^T / (2 i w_d) / (i w - pole) + conjugate``. Otherwise poles and vectors are those of
    ``[[C, M], [M, 0]] s + [[K, 0], [0, -M]]`` (Ewins, Modal Testing, 2nd ed., section 2.7).
    Modes above ``highest_frequency`` and overdamped modes are replaced by their static flexibility.

    Parameters
    ----------
    mass, damping, stiffness : (n, n), symmetric, mass positive definite
        Matrices M, C and K of the structure.
    observed : (n_labels, n)
        Matrix S: displacement of the labelled degrees of freedom over x.
    highest_frequency : Hz
        Highest undamped natural frequency that is retained as a mode.
    """
    squares, shapes = _modes(mass, stiffness)
    modal = shapes.T @ damping @ shapes
    coupling = np.abs(modal - np.diag(np.diag(modal))).max(initial=0.0)
    if coupling <= 1e-9 * np.abs(modal).max(initial=0.0):  # rounding of a diagonal matrix
        return from_real_modes(squares, shapes, np.diag(modal), observed, labels, highest_frequency)
    return _from_complex_modes(mass, damping, stiffness, observed, labels, highest_frequency)


def from_real_modes(
    squares: Real,
    shapes: Real,
    modal_damping: Real,
    observed: Real,
    labels: Sequence[str],
    highest_frequency: float = np.inf,
) -> ModalModel:
    """Build a modal model from mass-normalised shapes (n, n_modes), ``omega^2`` and ``2 zeta omega`` (n_modes,)."""
    natural = np.sqrt(squares)
    tip = (observed @ shapes).T
    retained = (natural < 2 * np.pi * highest_frequency) & (modal_damping < 2 * natural)
    damped = np.sqrt(squares[retained] - modal_damping[retained] ** 2 / 4)
    poles = -modal_damping[retained] / 2 + 1j * damped
    right = tip[retained].astype(complex)
    left_out = tip[~retained] / natural[~retained, None]
    residuals = None if retained.all() else Residuals(left_out.T @ left_out, np.zeros((len(labels), len(labels))))
    return ModalModel(poles, right, right / (2j * damped[:, None]), tuple(labels), tuple(labels), residuals=residuals)


def _from_complex_modes(
    mass: Real, damping: Real, stiffness: Real, observed: Real, labels: Sequence[str], highest_frequency: float
) -> ModalModel:
    zero = np.zeros_like(mass)
    poles, vectors = scipy.linalg.eig(
        np.block([[-stiffness, zero], [zero, mass]]), np.block([[damping, mass], [mass, zero]])
    )
    # of each conjugate pair one pole is kept; a pole on the real axis is overdamped
    retained = (poles.imag > 1e-9 * np.abs(poles)) & (np.abs(poles) < 2 * np.pi * highest_frequency)
    poles, upper = poles[retained], vectors[: len(mass), retained]
    order = np.argsort(np.abs(poles))
    poles, upper = poles[order], upper[:, order]
    norm = np.einsum("ir,ij,jr->r", upper, damping, upper) + 2 * poles * np.einsum("ir,ij,jr->r", upper, mass, upper)
    tip = (observed @ upper).T
    left = tip / norm[:, None]
    # the static flexibility of the modes that are left out is that of the structure minus that of the retained modes
    static = observed @ np.linalg.solve(stiffness, observed.T)
    modes = 2 * np.real(np.einsum("rp,rq->pq", tip / -poles[:, None], left))
    flexibility = (static - modes + (static - modes).T) / 2
    negligible = np.abs(flexibility).max(initial=0.0) <= 1e-9 * np.abs(static).max(initial=0.0)
    residuals = None if negligible else Residuals(flexibility, np.zeros_like(flexibility))
    return ModalModel(poles, tip, left, tuple(labels), tuple(labels), residuals=residuals)
