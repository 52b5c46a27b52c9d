"""Modes of a robot in a posture: computed, corrected by factors on its parts, measured, and paired."""

from dataclasses import dataclass

import numpy as np
import scipy

from millfrf.core import TIP, DegreeOfFreedom, InputError, Real
from modal_fit import ModalModel, derived_covariance

from ..finite_elements.statics import gravity_torques
from ..finite_elements.structure import Spring, Structure, rigid_motion
from ..kinematics.mechanism import close_loops
from ..settings import POSTURES
from ..spatial.spatial_modes import StructureModes, modes_at
from ..spatial.spatial_robot import SpatialRobot
from ..spatial.weight import acceleration


@dataclass(frozen=True)
class ModalBasis:
    """Mass-normalised modes of the robot as modelled, and the contribution of each part to them.

    ``diag(squares) = sum_k stiffness[k] + stiffness of weight`` and ``1 = sum_b mass[b]``, in modal coordinates.
    """

    squares: Real  # (n_modes,), (rad/s)^2: squared angular natural frequencies, rising
    tip: Real  # (n_modes, 3), kg^-1/2: motion of the tool tip in each mode, base frame
    stiffness: Real  # (n_stiffnesses, n_modes, n_modes), (rad/s)^2: each elastic joint, last links and motors together
    mass: Real  # (n_masses, n_modes, n_modes): each body, last links and motors together


@dataclass(frozen=True)
class PosturePlace:
    """Coordinates of a posture that its kernels compare."""

    driven: Real  # (n_active,), rad or m: driven joint values
    own: Real  # (n_stiffnesses,), rad or m: value of each elastic part's own joint; 0 where it has none
    load: Real  # (n_stiffnesses,), N m or N: moment (or force) of the weight about that joint


def basis_at(robot: SpatialRobot, driven: Real) -> tuple[ModalBasis, PosturePlace]:
    """Compute the modes of a posture with the contributions of joints, links and bodies; ``driven`` in rad and m."""
    if not robot.bodies and all(link.section is None for link in robot.links):
        raise InputError("this robot's file gives stiffness but no masses, so it has no modes; add [[bodies]]")
    q = close_loops(robot.mechanism, driven)
    modes = modes_at(robot, q)
    structure = modes.structure
    squares, shapes = _reduced(modes)
    stiffness = [_spring_part(spring, structure, shapes) for spring in structure.springs]
    mass = [_body_part(shapes[:, body.node], body.mass, body.centre, body.inertia) for body in structure.bodies]
    if structure.beams or structure.drives:
        flat = shapes.reshape(len(squares), -1)
        weight = 0.0 if structure.weight is None else flat @ structure.weight @ flat.T
        # links and motors are the difference to the modes' total, which is exact and needs no assembly of their own
        stiffness.append(np.diag(squares) - sum(stiffness) - weight)
        mass.append(np.eye(len(squares)) - sum(mass, np.zeros((len(squares),) * 2)))
    basis = ModalBasis(squares, shapes[:, structure.tip, :3], np.array(stiffness), np.array(mass))
    return basis, _place(robot, driven, q, structure)


def part_names(robot: SpatialRobot) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the stiffnesses and of the masses of :class:`ModalBasis`, in their order."""
    flexible = any(link.section is not None for link in robot.links)
    motors = any(joint.drive is not None for joint in robot.joints)
    remainder = " and ".join(name for name, exists in (("links", flexible), ("motors", motors)) if exists)
    last = (remainder,) if remainder else ()
    frames = [joint.frame for joint in robot.joints]
    springs = tuple(
        f"joint {frame}" + (f" ({frames[:i].count(frame) + 1})" if frame in frames[:i] else "")
        for i, frame in enumerate(frames)
    )
    bodies = tuple(f"body {number} on {body.frame}" for number, body in enumerate(robot.bodies, 1))
    return (*springs, *last), (*bodies, *last)


def arc_weights(robot: SpatialRobot, postures: Real) -> Real:
    """Compute the arc of the tip per radian of each driven joint over the largest arc, (n_active,), mean over postures.

    A prismatic joint has the reciprocal of the largest arm, 1/m, so that angles and travels are comparable.
    """
    mechanism = robot.mechanism
    tool = mechanism.index(mechanism.tool)
    columns = np.flatnonzero(mechanism.active)
    arms = np.zeros(len(columns))
    for driven in postures:
        placed = mechanism.transforms(close_loops(mechanism, driven))
        arms += np.linalg.norm(mechanism.jacobian(placed, tool)[:3, columns], axis=0) / len(postures)
    revolute = np.array([mechanism.frames[mechanism.moving[column]].motion == "revolute" for column in columns])
    reach = max(float(arms[revolute].max(initial=0.0)), 0.1)
    return np.where(revolute, np.maximum(arms / reach, POSTURES.least_arc), 1 / reach)


def _reduced(modes: StructureModes) -> tuple[Real, Real]:
    """Reduce the modes to the lowest modes and the static deflection of each joint; return squares and shapes.

    The lowest modes alone would be too stiff for a robot with a softer joint, which adds its static deflection.
    """
    count, lowest, structure = len(modes.squares), POSTURES.n_basis_modes, modes.structure
    relative = [
        _relative(spring, structure, modes.shapes)[:, np.isfinite(spring.stiffness)] for spring in structure.springs
    ]
    static = np.hstack(relative) / modes.squares[:, None]
    if count <= lowest + static.shape[1]:
        return modes.squares, modes.shapes
    static[:lowest] = 0.0
    directions, sizes, _ = np.linalg.svd(static, full_matrices=False)
    basis = np.hstack([np.eye(count)[:, :lowest], directions[:, sizes > 1e-6 * sizes.max(initial=0.0)]])
    squares, vectors = np.linalg.eigh(basis.T @ (modes.squares[:, None] * basis))
    return squares, np.tensordot((basis @ vectors).T, modes.shapes, 1)


def _relative(spring: Spring, structure: Structure, shapes: Real) -> Real:
    """Compute the relative motion at a joint in each mode, in the joint's axes, (n_modes, 6)."""
    before, after = spring.motions(structure.positions)
    return np.asarray(shapes[:, spring.nodes[1]] @ after.T - shapes[:, spring.nodes[0]] @ before.T)


def _spring_part(spring: Spring, structure: Structure, shapes: Real) -> Real:
    relative = _relative(spring, structure, shapes)
    elastic = np.where(np.isfinite(spring.stiffness), spring.stiffness, 0.0)
    return np.asarray((relative * elastic) @ relative.T)


def _body_part(motion: Real, mass: float, centre: Real, inertia: Real) -> Real:
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


@dataclass(frozen=True)
class CorrectedModes:
    """Modes of a robot whose parts have factors."""

    natural: Real  # (n_modes,), rad/s: angular natural frequencies, rising
    vectors: Real  # (n_modes, n_modes): mass-normalised shapes over the basis, as columns
    tip: Real  # (n_modes, 3), kg^-1/2: motion of the tip in each mode, base frame
    shares: Real  # (n_modes, n_stiffnesses): share of each elastic part in a mode's strain energy
    masses: Real  # (n_modes, n_masses): share of each mass in its kinetic energy


def corrected_modes(basis: ModalBasis, stiffness: Real, mass: Real) -> CorrectedModes:
    """Solve ``(diag(w^2) + sum_k (e^s_k - 1) G_k) v = lambda (I + sum_b (e^m_b - 1) M_b) v``.

    ``stiffness`` s (n_stiffnesses,) and ``mass`` m (n_masses,) are logarithms of the parts' factors.
    """
    parts = np.exp(stiffness)[:, None, None] * basis.stiffness
    inertias = np.exp(mass)[:, None, None] * basis.mass
    elasticity = np.diag(basis.squares) + np.tensordot(np.expm1(stiffness), basis.stiffness, 1)
    inertia = np.eye(len(elasticity)) + np.tensordot(np.expm1(mass), basis.mass, 1)
    squares, vectors = scipy.linalg.eigh(elasticity, inertia)
    squares = np.maximum(squares, 1e-6 * basis.squares[0])
    # the solver's signs change by rounding, and draws of shapes with them
    tip = vectors.T @ basis.tip
    vectors = vectors * np.where(tip[np.arange(len(tip)), np.abs(tip).argmax(axis=1)] < 0, -1.0, 1.0)
    shares = np.einsum("ir,kij,jr->rk", vectors, parts, vectors, optimize=True) / squares[:, None]
    masses = np.einsum("ir,bij,jr->rb", vectors, inertias, vectors, optimize=True)
    return CorrectedModes(np.sqrt(squares), vectors, vectors.T @ basis.tip, shares, masses)


def shape_slopes(basis: ModalBasis, modes: CorrectedModes, stiffness: Real, mass: Real, mode: int) -> tuple[Real, Real]:
    """Compute derivatives of a mode's tip motion over stiffness and mass, (3, n_stiffnesses) and (3, n_masses).

    ``dphi_r = sum_s phi_s v_s^T (dK - lambda_r dM) v_r / (lambda_r - lambda_s) - phi_r v_r^T dM v_r / 2`` (Fox &
    Kapoor, AIAA Journal 6, 1968).
    """
    square = modes.natural[mode] ** 2
    gap = (square - modes.natural**2) / square
    # the fraction is limited where two modes are close, because it is infinite where they cross
    coupling = gap / (gap**2 + POSTURES.close_squares**2) / square
    coupling[mode] = 0.0
    vector = modes.vectors[:, mode]
    by_stiffness = np.exp(stiffness) * (modes.vectors.T @ (basis.stiffness @ vector).T)
    by_mass = np.exp(mass) * (modes.vectors.T @ (basis.mass @ vector).T)
    mixed = coupling[:, None] * by_stiffness, -square * coupling[:, None] * by_mass
    own = np.outer(modes.tip[mode], modes.masses[mode]) / 2
    return modes.tip.T @ mixed[0], modes.tip.T @ mixed[1] - own


def modelled_damping(robot: SpatialRobot, natural: Real) -> Real:
    """Compute the damping ratios at angular frequencies (rad/s) from the robot's ratio or Rayleigh constants."""
    if robot.damping_ratio is not None:
        return np.full(len(natural), max(robot.damping_ratio, POSTURES.assumed_damping))
    a, b = robot.rayleigh
    return np.maximum((a / natural + b * natural) / 2, POSTURES.assumed_damping)


Pairs = tuple[tuple[int, int], ...]  # (measured, computed): indices of modes that are the same


@dataclass(frozen=True)
class MeasuredModes:
    """Modes measured in one posture."""

    name: str  # of the measurement
    driven: Real  # (n_active,), rad or m: driven joint values
    frequencies: Real  # (n_modes,), Hz, undamped
    damping: Real  # (n_modes,): damping ratios
    shapes: Real  # (n_modes, n_directions), kg^-1/2: mass-normalised motion of the tip, of either sign
    errors: Real  # (n_modes, 3): relative standard errors of frequency, damping ratio and shape
    directions: Real  # (n_directions, 3): unit vectors of the measured directions, in the base frame


def measured_modes(name: str, driven: Real, model: ModalModel, axes: Real | None = None) -> MeasuredModes:
    """Take frequencies, damping and mass-normalised tip motion out of a measured modal model.

    ``R = 2 i w_d A`` of a mode with residue A is ``phi phi^T`` where damping is light; ``phi`` is the largest
    eigenvector of its real symmetric part.

    Parameters
    ----------
    name
        Name of the measurement.
    driven : (n_active,), rad or m
        Driven joint values of the posture.
    model
        Receptance with at least one direction of the tip both excited and measured.
    axes : (3, 3) or None
        X, Y, Z of the model as columns, in the base frame; None: the base frame.

    Raises
    ------
    InputError
        Another quantity, no direction of the tip that is both excited and measured, or a mode that is not damped.
    """
    if model.quantity != "receptance":
        raise InputError(f"{name}: a model of {model.quantity}; learning needs a receptance at the tool tip")
    responses, excitations = _tip_channels(model.responses), _tip_channels(model.excitations)
    driving = {axis: excitations[axis] for axis in responses if axis in excitations}
    if not driving:
        raise InputError(
            f"{name}: no direction of the tip ({', '.join(TIP)}) is both measured and excited; measure a driving point"
        )
    if not len(model.poles) or model.poles.real.max() >= 0:
        raise InputError(f"{name}: the model has no modes, or one that does not decay; fit it again")
    axes = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    shapes = _shapes(model, responses, driving)
    return MeasuredModes(
        name,
        np.asarray(driven, dtype=float),
        model.natural_frequencies,
        model.damping_ratios,
        shapes,
        _errors(model, shapes, responses, driving),
        axes[:, sorted(responses)].T,
    )


_Channels = dict[int, tuple[int, float]]  # for each axis of the tip (0 to 2) the index and sign of its channel


def _tip_channels(labels: tuple[str, ...]) -> _Channels:
    node = TIP[0].partition(":")[0]
    channels: _Channels = {}
    for index, label in enumerate(labels):
        dof = DegreeOfFreedom.parse(label)
        if dof.node == node and dof.direction[1:] in ("X", "Y", "Z"):
            channels.setdefault("XYZ".index(dof.direction[1:]), (index, dof.sign))
    return channels


def _shapes(model: ModalModel, responses: _Channels, excitations: _Channels) -> Real:
    """Extract the mass-normalised motion of each mode along all measured directions, (n_modes, n_directions)."""
    rows, columns = sorted(responses), sorted(excitations)
    right = np.stack([model.right[:, responses[axis][0]] * responses[axis][1] for axis in rows], axis=1)
    left = np.stack([model.left[:, excitations[axis][0]] * excitations[axis][1] for axis in columns], axis=1)
    products = np.real(2j * model.poles.imag[:, None, None] * right[:, :, None] * left[:, None, :])
    driving = [rows.index(axis) for axis in columns]
    square = products[:, driving]
    values, vectors = np.linalg.eigh((square + square.transpose(0, 2, 1)) / 2)
    size = np.sqrt(np.maximum(values[:, -1], 0.0))
    shapes = np.einsum("rpq,rq->rp", products, vectors[:, :, -1]) / np.maximum(size, 1e-12)[:, None]
    shapes[:, driving] = vectors[:, :, -1] * size[:, None]
    return np.asarray(shapes)


def _errors(model: ModalModel, shapes: Real, responses: _Channels, excitations: _Channels) -> Real:
    """Compute relative standard errors of frequency, damping and shape, not below the least errors, (n_modes, 3)."""

    def same_sign(changed: ModalModel) -> Real:
        # the eigenvector's sign is arbitrary and would make the derivative jump
        moved = _shapes(changed, responses, excitations)
        opposite = np.sum(moved * shapes, axis=1) < 0
        return np.where(opposite[:, None], -moved, moved).ravel()

    errors = np.tile(POSTURES.assumed_errors, (len(model.poles), 1))
    covariance = derived_covariance(model, same_sign)
    if covariance is not None:
        spread = np.diag(covariance).reshape(shapes.shape)
        size = np.maximum(np.linalg.norm(shapes, axis=1), 1e-12)
        errors[:, 2] = np.sqrt(np.maximum(spread.mean(axis=1), 0.0)) / size
    standard_errors = model.standard_errors()
    if standard_errors is not None:
        errors[:, 0] = standard_errors[0] / model.natural_frequencies
        errors[:, 1] = standard_errors[1] / model.damping_ratios
    return np.asarray(np.maximum(errors, POSTURES.least_errors))


def mode_pairs(
    frequencies: Real,
    shapes: Real,
    computed: Real,
    computed_shapes: Real,
    scales: tuple[float, float] = POSTURES.pairing_scales,
) -> Pairs:
    """Pair measured modes with computed ones at the least total distance.

    ``(log f / g)^2 / a^2 + min |phi -+ psi|^2 / (b^2 |phi| |psi|)``, with (a, b) the ``scales``. Pairs (measured,
    computed) are in the order of the measured modes; a mode without a computed one near its frequency has none.

    Parameters
    ----------
    frequencies, computed : (n_measured,) and (n_computed,), Hz
        Natural frequencies.
    shapes, computed_shapes : (n_measured, n_directions) and (n_computed, n_directions)
        Motion of the tip along the same directions.

    Examples
    --------
    >>> exchanged = np.eye(2)[::-1]
    >>> mode_pairs(np.array([10.0, 10.5]), np.eye(2), np.array([10.2, 10.3]), exchanged)
    ((0, 1), (1, 0))
    """
    ratio = np.log(frequencies)[:, None] - np.log(computed)[None, :]
    first, second = np.linalg.norm(shapes, axis=1), np.linalg.norm(computed_shapes, axis=1)
    sizes = np.maximum(np.outer(first, second), 1e-30)
    difference = (first[:, None] ** 2 + second[None, :] ** 2 - 2 * np.abs(shapes @ computed_shapes.T)) / sizes
    cost = (ratio / scales[0]) ** 2 + np.minimum(difference, 4.0) / scales[1] ** 2
    never = 1e4  # larger than any other cost, so that the assignment avoids it
    cost[np.abs(ratio) > POSTURES.largest_frequency_ratio] = never
    rows, columns = scipy.optimize.linear_sum_assignment(cost)
    return tuple((int(i), int(j)) for i, j in zip(rows, columns, strict=True) if cost[i, j] < never)
