"""`ModalBasis`: modes of a robot in a posture, and how they move with factors of its parts."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..finite_elements.statics import gravity_torques
from ..finite_elements.structure import Spring, Structure, rigid_motion
from ..kinematics.mechanism import close_loops
from ..spatial.spatial_modes import StructureModes, modes_at
from ..spatial.spatial_robot import SpatialRobot
from ..spatial.weight import acceleration

LOWEST_MODES = 24
"""Modes that a basis keeps, beside one static deflection for each direction in which a joint gives way."""


@dataclass(frozen=True)
class ModalBasis:
    """Mass-normalised modes of the robot as modelled, and what each part contributes to them.

    ``diag(squares) = sum_k stiffness[k] + stiffness of weight`` and ``1 = sum_b mass[b]``, all over modal coordinates.

    Parameters
    ----------
    squares : (n_modes,), (rad/s)^2
        Squared angular natural frequencies, rising.
    tip : (n_modes, 3), kg^-1/2
        Motion of the tool tip in each mode, in the base frame.
    stiffness : (n_stiffnesses, n_modes, n_modes), (rad/s)^2
        Part of each elastic joint, and last of flexible links and motors where there are some.
    mass : (n_masses, n_modes, n_modes)
        Part of each body, and last of the links where they have mass.
    """

    squares: Real
    tip: Real
    stiffness: Real
    mass: Real


@dataclass(frozen=True)
class PosturePlace:
    """Where a posture lies, as the kernels see it.

    Parameters
    ----------
    driven : (n_active,), rad or m
        Driven joint values.
    own : (n_stiffnesses,), rad or m
        Value of each elastic part's own joint; 0 where it has none.
    load : (n_stiffnesses,), N m or N
        Turning moment (or push) of the weight about that joint.
    """

    driven: Real
    own: Real
    load: Real


def basis_at(robot: SpatialRobot, driven: Real) -> tuple[ModalBasis, PosturePlace]:
    """Modes of a posture divided among joints, links and bodies; ``driven`` (n_active,) in rad and m.

    Raises
    ------
    InputError
        A robot without masses, or a posture that its loops cannot close.
    """
    if not robot.bodies and all(link.section is None for link in robot.links):
        raise InputError("this robot's file gives stiffness but no masses: it has no modes to learn from")
    q = close_loops(robot.mechanism, driven)
    modes = modes_at(robot, q)
    structure = modes.structure
    squares, shapes = _narrowed(modes)
    stiffness = [_spring(spring, structure, shapes) for spring in structure.springs]
    mass = [_body(shapes[:, body.node], body.mass, body.centre, body.inertia) for body in structure.bodies]
    if structure.beams or structure.drives:
        flat = shapes.reshape(len(squares), -1)
        weight = 0.0 if structure.weight is None else flat @ structure.weight @ flat.T
        stiffness.append(np.diag(squares) - sum(stiffness) - weight)
        mass.append(np.eye(len(squares)) - sum(mass, np.zeros((len(squares),) * 2)))
    basis = ModalBasis(squares, shapes[:, structure.tip, :3], np.array(stiffness), np.array(mass))
    return basis, _place(robot, driven, q, structure)


def part_names(robot: SpatialRobot) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the stiffnesses and of the masses of :class:`ModalBasis`, in their order."""
    flexible = any(link.section is not None for link in robot.links)
    motors = any(joint.drive is not None for joint in robot.joints)
    rest = " and ".join(name for name, there in (("links", flexible), ("motors", motors)) if there)
    last = (rest,) if rest else ()
    frames = [joint.frame for joint in robot.joints]
    springs = tuple(
        f"joint {frame}" + (f" ({frames[:i].count(frame) + 1})" if frame in frames[:i] else "")
        for i, frame in enumerate(frames)
    )
    bodies = tuple(f"body {number} on {body.frame}" for number, body in enumerate(robot.bodies, 1))
    return (*springs, *last), (*bodies, *last)


def arc_weights(robot: SpatialRobot, postures: Real) -> Real:
    """How far the tip moves when each driven joint turns, over the farthest; at least ``0.15``; shape (n_active,).

    Prismatic joints: one over the largest arm, 1/m, so that angles and travels are both arcs of the tip over the reach.
    """
    mechanism = robot.mechanism
    tool = mechanism.index(mechanism.tool)
    columns = np.flatnonzero(mechanism.active)
    arms = np.zeros(len(columns))
    for driven in postures:
        placed = mechanism.transforms(close_loops(mechanism, driven))
        arms += np.linalg.norm(mechanism.jacobian(placed, tool)[:3, columns], axis=0) / len(postures)
    turns = np.array([mechanism.frames[mechanism.moving[column]].motion == "revolute" for column in columns])
    reach = max(float(arms[turns].max(initial=0.0)), 0.1)
    return np.where(turns, np.maximum(arms / reach, SMALLEST_ARC), 1 / reach)


SMALLEST_ARC = 0.15
"""A joint whose turn leaves the tip where it is still turns the masses and springs beyond it."""


def _narrowed(modes: StructureModes) -> tuple[Real, Real]:
    """Squares and shapes of the lowest modes and the joints' static deflections, which a softer joint adds to them."""
    count, structure = len(modes.squares), modes.structure
    relative = [
        _relative(spring, structure, modes.shapes)[:, np.isfinite(spring.stiffness)] for spring in structure.springs
    ]
    static = np.hstack(relative) / modes.squares[:, None]
    if count <= LOWEST_MODES + static.shape[1]:
        return modes.squares, modes.shapes
    static[:LOWEST_MODES] = 0.0
    wide, sizes, _ = np.linalg.svd(static, full_matrices=False)
    basis = np.hstack([np.eye(count)[:, :LOWEST_MODES], wide[:, sizes > 1e-6 * sizes.max(initial=0.0)]])
    squares, turned = np.linalg.eigh(basis.T @ (modes.squares[:, None] * basis))
    return squares, np.tensordot((basis @ turned).T, modes.shapes, 1)


def _relative(spring: Spring, structure: Structure, shapes: Real) -> Real:
    """Relative motion at a joint in each mode, in its axes, (n_modes, 6)."""
    before, after = spring.motions(structure.positions)
    return np.asarray(shapes[:, spring.nodes[1]] @ after.T - shapes[:, spring.nodes[0]] @ before.T)


def _spring(spring: Spring, structure: Structure, shapes: Real) -> Real:
    """Energy of one joint over modal coordinates."""
    relative = _relative(spring, structure, shapes)
    elastic = np.where(np.isfinite(spring.stiffness), spring.stiffness, 0.0)
    return np.asarray((relative * elastic) @ relative.T)


def _body(motion: Real, mass: float, centre: Real, inertia: Real) -> Real:
    moved = motion @ rigid_motion(centre).T
    return np.asarray(mass * moved[:, :3] @ moved[:, :3].T + moved[:, 3:] @ inertia @ moved[:, 3:].T)


def _place(robot: SpatialRobot, driven: Real, q: Real, structure: Structure) -> PosturePlace:
    mechanism = robot.mechanism
    names = [mechanism.frames[index].name for index in mechanism.moving]
    torques = gravity_torques(robot, q, structure, acceleration(robot))
    count = len(robot.joints) + bool(structure.beams or structure.drives)
    own, load = np.zeros(count), np.zeros(count)
    for part, joint in enumerate(robot.joints):
        if joint.frame in names:
            own[part], load[part] = q[names.index(joint.frame)], torques[names.index(joint.frame)]
    return PosturePlace(np.asarray(driven, dtype=float), own, load)


CLOSE = 0.02
"""Relative distance of two squared frequencies below which their shapes' derivatives are kept from growing."""


@dataclass(frozen=True)
class CorrectedModes:
    """Modes under corrections.

    Parameters
    ----------
    natural : (n_modes,), rad/s
        Angular natural frequencies, rising.
    vectors : (n_modes, n_modes)
        Mass-normalised shapes over the basis, as columns.
    tip : (n_modes, 3), kg^-1/2
        Motion of the tip in each mode, base frame.
    shares : (n_modes, n_stiffnesses)
        Share of each elastic part in a mode's energy.
    masses : (n_modes, n_masses)
        Share of each mass in it.
    """

    natural: Real
    vectors: Real
    tip: Real
    shares: Real
    masses: Real


def corrected_modes(basis: ModalBasis, stiffness: Real, mass: Real) -> CorrectedModes:
    """Solve ``(diag(w^2) + sum_k (e^s_k - 1) G_k) v = lambda (I + sum_b (e^m_b - 1) M_b) v``.

    Parameters
    ----------
    basis
        Modes as modelled, in the posture.
    stiffness : (n_stiffnesses,)
        Logarithms s of the factors of the elastic parts.
    mass : (n_masses,)
        Logarithms m of the factors of the masses.
    """
    parts = np.exp(stiffness)[:, None, None] * basis.stiffness
    inertias = np.exp(mass)[:, None, None] * basis.mass
    whole = np.diag(basis.squares) + np.tensordot(np.expm1(stiffness), basis.stiffness, 1)
    inertia = np.eye(len(whole)) + np.tensordot(np.expm1(mass), basis.mass, 1)
    squares, vectors = scipy.linalg.eigh(whole, inertia)
    squares = np.maximum(squares, 1e-6 * basis.squares[0])
    shares = np.einsum("ir,kij,jr->rk", vectors, parts, vectors, optimize=True) / squares[:, None]
    masses = np.einsum("ir,bij,jr->rb", vectors, inertias, vectors, optimize=True)
    return CorrectedModes(np.sqrt(squares), vectors, vectors.T @ basis.tip, shares, masses)


def shape_slopes(basis: ModalBasis, modes: CorrectedModes, stiffness: Real, mass: Real, mode: int) -> tuple[Real, Real]:
    """Derivatives of one mode's motion of the tip by the logarithms, (3, n_stiffnesses) and (3, n_masses).

    ``dphi_r = sum_s phi_s v_s^T (dK - lambda_r dM) v_r / (lambda_r - lambda_s) - phi_r v_r^T dM v_r / 2`` (Fox &
    Kapoor, AIAA Journal 6, 1968); where two modes are close, the fraction is kept from growing.
    """
    square = modes.natural[mode] ** 2
    gap = (square - modes.natural**2) / square
    pull = gap / (gap**2 + CLOSE**2) / square
    pull[mode] = 0.0
    vector = modes.vectors[:, mode]
    by_stiffness = np.exp(stiffness) * (modes.vectors.T @ (basis.stiffness @ vector).T)
    by_mass = np.exp(mass) * (modes.vectors.T @ (basis.mass @ vector).T)
    mixed = pull[:, None] * by_stiffness, -square * pull[:, None] * by_mass
    own = np.outer(modes.tip[mode], modes.masses[mode]) / 2
    return modes.tip.T @ mixed[0], modes.tip.T @ mixed[1] - own


def modelled_damping(robot: SpatialRobot, natural: Real) -> Real:
    """Damping ratios that the robot's file gives at angular frequencies (rad/s): one ratio, or Rayleigh's."""
    if robot.damping_ratio is not None:
        return np.full(len(natural), max(robot.damping_ratio, SMALLEST_RATIO))
    a, b = robot.rayleigh
    return np.maximum((a / natural + b * natural) / 2, SMALLEST_RATIO)


SMALLEST_RATIO = 1e-4
"""Damping ratio that stands in where a file gives none: a logarithm needs one."""
