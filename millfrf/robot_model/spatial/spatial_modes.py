"""Natural frequencies, mode shapes and the `ModalModel` at the tool tip in a posture."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import HOUSING, TIP, InputError, Real
from modal_fit import ModalModel

from ..finite_elements.reduction import from_real_modes, modal_model
from ..finite_elements.structure import Structure, coordinate_basis, mass_matrix, six_by_six, stiffness_matrix
from ..kinematics.mechanism import drive_direction
from .spatial_robot import ElasticJoint, LumpedBody, SpatialRobot, node_bodies, structure_at

TIP_ROTATIONS = ("TCP:+RX", "TCP:+RY", "TCP:+RZ")


@dataclass(frozen=True)
class StructureModes:
    """Undamped modes of a structure at one posture.

    Parameters
    ----------
    structure
        Structure whose modes these are.
    squares : (n_modes,), (rad/s)^2
        Squared angular natural frequencies omega^2, rising.
    shapes : (n_modes, n_nodes, 6)
        Displacement and rotation of every node, mass-normalised, in the base frame.
    """

    structure: Structure
    squares: Real
    shapes: Real

    @property
    def frequencies(self) -> Real:
        """Natural frequencies, Hz, shape (n_modes,)."""
        return np.sqrt(self.squares) / (2 * np.pi)


def modes_at(robot: SpatialRobot, q: Real) -> StructureModes:
    """``(K - omega^2 M) P = 0`` at the joint values q (n_moving,), constraints built in (Mousavi et al., Eq. 12).

    Raises
    ------
    InputError
        A coordinate without mass, or a structure that is not held.
    """
    structure = structure_at(robot, q)
    basis = coordinate_basis(structure)
    stiffness = basis.T @ stiffness_matrix(structure) @ basis
    mass = basis.T @ mass_matrix(structure) @ basis
    try:
        squares, vectors = scipy.linalg.eigh(stiffness, mass)
    except np.linalg.LinAlgError as error:
        raise InputError(
            "the mass matrix is singular: a node has no mass; add [[bodies]] to the robot's file"
        ) from error
    if squares[0] <= 0:
        raise InputError(f"the structure is not held: lowest omega^2 = {squares[0]:.3g}; check joints and links")
    shapes = (basis @ vectors).T.reshape(len(squares), -1, 6)
    return StructureModes(structure, squares, shapes)


def modal_model_at(
    robot: SpatialRobot,
    q: Real,
    *,
    axes: Real | None = None,
    rotations: bool = False,
    highest_frequency: float = np.inf,
) -> ModalModel:
    """Give the modal model at the tool tip in a posture, damped as the robot says (Rayleigh, or one ratio).

    Parameters
    ----------
    robot
        Robot whose structure is computed.
    q : (n_moving,), rad or m
        Joint values of the posture.
    axes : (3, 3) or None
        Axes X, Y, Z of the wanted frame (feed, normal, axial) as columns in the base frame; None: the base frame.
    rotations
        Whether rotations and moments are included: six degrees of freedom instead of three.
    highest_frequency : Hz
        Highest natural frequency that is kept; higher modes, and overdamped ones, are left as their static flexibility.
    """
    return model_of_modes(
        modes_at(robot, q), robot, axes=axes, rotations=rotations, highest_frequency=highest_frequency
    )


def model_of_modes(
    modes: StructureModes,
    robot: SpatialRobot,
    *,
    axes: Real | None = None,
    rotations: bool = False,
    highest_frequency: float = np.inf,
) -> ModalModel:
    """The same from modes that are known."""
    turn = six_by_six(np.eye(3) if axes is None else np.asarray(axes, dtype=float)).T
    tip = modes.shapes[:, modes.structure.tip] @ turn.T
    labels = (*TIP, *TIP_ROTATIONS) if rotations else TIP
    shapes = tip[:, : len(labels)].T
    if any(joint.damping for joint in robot.joints):
        unit, stiffness = np.eye(len(modes.squares)), np.diag(modes.squares)
        return modal_model(unit, damping_of_modes(robot, modes), stiffness, shapes, labels, highest_frequency)
    damping = modal_damping(robot, modes.squares)
    return from_real_modes(modes.squares, shapes, damping, np.eye(len(labels)), labels, highest_frequency)


def modal_damping(robot: SpatialRobot, squares: Real) -> Real:
    """``2 zeta omega`` of every mode: ``a + b omega^2`` (Mousavi et al., Eq. 10) or one ratio; rad/s, (n_modes,)."""
    if robot.damping_ratio is not None:
        return np.asarray(2 * robot.damping_ratio * np.sqrt(squares))
    a, b = robot.rayleigh
    return a + b * squares


def damping_of_modes(robot: SpatialRobot, modes: StructureModes) -> Real:
    """Damping matrix over mass-normalised modes, ``diag(2 zeta omega) + sum_j c_j b_j b_j^T``, rad/s, (n, n).

    ``b_j`` holds each mode's motion in joint j, about or along the joint's axis; c_j is that joint's own damping.

    Raises
    ------
    InputError
        A direction that is not damped: the joints' damping of negative sign is more than the robot's.
    """
    whole = np.diag(modal_damping(robot, modes.squares))
    if not any(joint.damping for joint in robot.joints):
        return whole
    motions = {frame.name: drive_direction(frame) for frame in robot.mechanism.frames}
    for joint, spring in zip(robot.joints, modes.structure.springs, strict=True):
        if joint.damping:
            before, after = (part[motions[joint.frame]] for part in spring.motions(modes.structure.positions))
            first, second = spring.nodes
            moved = modes.shapes[:, second] @ after - modes.shapes[:, first] @ before
            whole += joint.damping * np.outer(moved, moved)
    least = float(np.linalg.eigvalsh(whole)[0])
    if least < -1e-9 * float(np.abs(whole).max()):
        raise InputError(
            f"the joints' damping leaves a motion with {least:.3g} 1/s: it must not be negative; "
            "raise damping_nms_per_rad, or the robot's [damping]"
        )
    return whole


def damping_warnings(robot: SpatialRobot, modes: StructureModes) -> tuple[str, ...]:
    """Warn in one sentence of large Rayleigh damping in high modes; empty where all stay below 20 %."""
    ratios = np.diag(damping_of_modes(robot, modes)) / (2 * np.sqrt(modes.squares))
    high = modes.frequencies > 20.0
    if not np.any(ratios[high] > 0.2):
        return ()
    first = modes.frequencies[high & (ratios > 0.2)][0]
    count = int(np.sum(ratios >= 1))
    return (
        f"Rayleigh damping gives more than 20 % from {first:.0f} Hz on, and {count} modes are overdamped; "
        "two measured ratios at low frequencies say nothing about high ones: give a ratio instead",
    )


def frf_at(robot: SpatialRobot, q: Real, frequencies: Real, *, axes: Real | None = None) -> Frf:
    """Receptance at the tool tip, all modes, overdamped ones included exactly; frequencies in Hz."""
    modes = modes_at(robot, q)
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    tip = modes.shapes[:, modes.structure.tip, :3] @ turn
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)[:, None]
    damping = damping_of_modes(robot, modes)
    if any(joint.damping for joint in robot.joints):
        stiffness = np.eye(len(damping)) * (modes.squares - omega**2)[:, None, :]
        values = tip.T @ np.linalg.solve(stiffness + 1j * omega[:, :, None] * damping, tip.astype(complex))
    else:
        gain = 1 / (modes.squares - omega**2 + 1j * omega * np.diag(damping))
        values = np.einsum("kr,rp,rq->kpq", gain, tip, tip, optimize=True)
    valid = np.ones(len(omega), dtype=bool)
    return Frf(omega[:, 0] / (2 * np.pi), values, TIP, TIP, "receptance", "m/N", valid)


TOOL_MASS = 0.2
"""Mass of a small end mill with its collet, kg: with 0.1 um/N its own mode is at 1.1 kHz, above a robot's band."""

STIFFEST = 1e-12
"""Compliance below which the spring is rigid, m/N."""


def tool_spring(robot: SpatialRobot) -> ElasticJoint | None:
    """The spring that ends at the tool tip in the frame of the tool, or None where the robot has none."""
    ends = (joint for joint in robot.joints if joint.frame == robot.mechanism.tool and joint.nodes[1] == robot.tip)
    return next(ends, None)


def housing_node(robot: SpatialRobot) -> int:
    """Node of the spindle's housing: before the tool's spring, or the tip itself where the tool is rigid."""
    spring = tool_spring(robot)
    return robot.tip if spring is None else spring.nodes[0]


def with_tool_spring(
    robot: SpatialRobot, lateral: float, axial: float = 0.0, tool_mass: float = TOOL_MASS
) -> SpatialRobot:
    """The robot with a tool that gives way: ``x_tip = x_spindle + C F`` in the tool frame, ``C = diag(c, c, c_z)``.

    The tool's own mode is at ``sqrt(1 / (c m)) / (2 pi)``. Where the robot has a tool spring, compliances are added.

    Parameters
    ----------
    robot
        Its tool frame has z along the tool.
    lateral
        Compliance c across the tool, m/N.
    axial
        Compliance along the tool, m/N.
    tool_mass
        Mass of the tool that moves on the spring, kg.

    Raises
    ------
    InputError
        A compliance that is negative or infinite, or a mass that is not positive.
    """
    for name, compliance in (("lateral", lateral), ("axial", axial)):
        if not (np.isfinite(compliance) and compliance >= 0):
            raise InputError(f"{name} tool compliance {compliance!r} m/N must be zero or more, for example 1e-7")
    if not tool_mass > 0:
        raise InputError(f"tool mass {tool_mass!r} kg must be positive, for example {TOOL_MASS}")
    added = np.array([lateral, lateral, axial])
    spring = tool_spring(robot)
    if spring is not None:
        softer = replace(
            spring, stiffness=np.append(_stiffness(1 / spring.stiffness[:3] + added), spring.stiffness[3:])
        )
        return replace(robot, joints=tuple(softer if joint is spring else joint for joint in robot.joints))
    tip, frame = robot.n_nodes, robot.mechanism.tool
    joint = ElasticJoint(frame, (robot.tip, tip), np.append(_stiffness(added), np.full(3, np.inf)))
    body = LumpedBody(tip, frame, tool_mass, np.zeros(3), np.zeros((3, 3)))
    return replace(robot, joints=(*robot.joints, joint), bodies=(*robot.bodies, body), tip=tip)


def _stiffness(compliance: Real) -> Real:
    return np.where(compliance > STIFFEST, 1 / np.maximum(compliance, STIFFEST), np.inf)


def cell_structure_at(
    robot: SpatialRobot, q: Real, sensor: Real, *, axes: Real | None = None, highest_frequency: float = 2000.0
) -> ModalModel:
    """Give the modal model with motion at the tip and at a sensor on the spindle, and forces at the tip.

    The sensor sits on the spindle: it moves by ``t + theta x r`` with the translation and rotation, in every mode, of
    the tip, or of the node before the tool's spring where the robot has one (Mohammadi & Ahmadi, Fig. 12 a). Modes are
    real, so that ``sum 2 Re(right left^T) = 0``: a step of force gives no step of velocity. Higher and overdamped modes
    are dropped, without a residual: the cell integrates modes. Of the joints' own damping each mode gets its share;
    what couples modes is left out.

    Parameters
    ----------
    robot
        Robot whose structure is computed.
    q : (n_moving,), rad or m
        Joint values of the posture.
    sensor : (3,), m
        Place of the sensor from the tip, in the axes of the model.
    axes : (3, 3) or None
        Axes X, Y, Z of the model as columns, in the base frame.
    highest_frequency : Hz
        Highest undamped natural frequency that is kept.

    Raises
    ------
    InputError
        No damped mode is left.
    """
    modes = modes_at(robot, q)
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    tip = modes.shapes[:, modes.structure.tip]
    housing = modes.shapes[:, housing_node(robot)]
    moved, held, turned = tip[:, :3] @ turn, housing[:, :3] @ turn, housing[:, 3:] @ turn
    natural, twice = np.sqrt(modes.squares), np.diag(damping_of_modes(robot, modes))
    kept = (natural < 2 * np.pi * highest_frequency) & (twice < 2 * natural) & (twice > 0)
    if not kept.any():
        raise InputError("no damped mode is left for the simulated cell; give the robot damping, or more modes")
    damped = np.sqrt(modes.squares[kept] - twice[kept] ** 2 / 4)
    right = np.hstack([moved, held + np.cross(turned, np.asarray(sensor, dtype=float))])[kept].astype(complex)
    left = moved[kept] / (2j * damped[:, None])
    return ModalModel(-twice[kept] / 2 + 1j * damped, right, left, (*TIP, *HOUSING), TIP)


def check_tip(robot: SpatialRobot) -> None:
    """Refuse a tip node that is not at the origin of the tool frame: postures aim the one, forces act on the other.

    Raises
    ------
    InputError
        The two stand apart, or on different bodies.
    """
    mechanism = robot.mechanism
    q = np.zeros(len(mechanism.moving))
    rigid = replace(robot, links=(), gravity=0.0)
    apart = (
        structure_at(rigid, q).positions[robot.tip] - mechanism.transforms(q)[mechanism.index(mechanism.tool), :3, 3]
    )
    distance = float(np.linalg.norm(apart))
    if distance > 1e-6 or node_bodies(robot)[robot.tip] != mechanism.body_of[mechanism.tool]:
        raise InputError(
            f"tip_node {robot.tip} stands {distance:.3g} m from the origin of the tool frame {mechanism.tool!r}, or on "
            "another body; place that node in the tool frame at [0, 0, 0]"
        )
