"""Natural frequencies, mode shapes, and the `ModalModel` at the tool tip in a posture."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from estimation import Frf
from millfrf.core import HOUSING, TIP, InputError, Real
from modal_fit import ModalModel

from ..finite_elements.structure import (
    Structure,
    coordinate_basis,
    from_real_modes,
    mass_matrix,
    modal_model,
    six_by_six,
    stiffness_matrix,
)
from ..kinematics.mechanism import drive_direction
from ..settings import ROBOT
from .spatial_robot import ElasticJoint, LumpedBody, SpatialRobot, structure_at

TOOL_MASS = ROBOT.tool_mass
TIP_ROTATIONS = ("TCP:+RX", "TCP:+RY", "TCP:+RZ")


@dataclass(frozen=True)
class StructureModes:
    """Undamped modes of a structure in one posture.

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
    """Solve ``(K - omega^2 M) P = 0`` at the joint values q (n_moving,), with constraints (Mousavi et al., Eq. 12).

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
    """Compute the modal model at the tool tip in a posture, with the damping of the robot (Rayleigh, or one ratio).

    Parameters
    ----------
    robot
        Robot whose structure is computed.
    q : (n_moving,), rad or m
        Joint values of the posture.
    axes : (3, 3) or None
        Axes X, Y, Z of the model (feed, normal, axial) as columns in the base frame; None: the base frame.
    rotations
        Whether rotations and moments are included: six degrees of freedom instead of three.
    highest_frequency : Hz
        Highest retained natural frequency; higher and overdamped modes are replaced by their static flexibility.
    """
    modes = modes_at(robot, q)
    return model_of_modes(modes, robot, axes=axes, rotations=rotations, highest_frequency=highest_frequency)


def model_of_modes(
    modes: StructureModes,
    robot: SpatialRobot,
    *,
    axes: Real | None = None,
    rotations: bool = False,
    highest_frequency: float = np.inf,
) -> ModalModel:
    """Compute the modal model of `modal_model_at` from modes that are already known."""
    turn = six_by_six(np.eye(3) if axes is None else np.asarray(axes, dtype=float)).T
    tip = modes.shapes[:, modes.structure.tip] @ turn.T
    labels = (*TIP, *TIP_ROTATIONS) if rotations else TIP
    shapes = tip[:, : len(labels)].T
    if robot.has_joint_damping:
        unit, stiffness = np.eye(len(modes.squares)), np.diag(modes.squares)
        return modal_model(unit, damping_of_modes(robot, modes), stiffness, shapes, labels, highest_frequency)
    damping = modal_damping(robot, modes.squares)
    return from_real_modes(modes.squares, shapes, damping, np.eye(len(labels)), labels, highest_frequency)


def modal_damping(robot: SpatialRobot, squares: Real) -> Real:
    """Compute ``2 zeta omega`` of every mode, rad/s: ``a + b omega^2`` (Mousavi et al., Eq. 10), or from one ratio."""
    if robot.damping_ratio is not None:
        return np.asarray(2 * robot.damping_ratio * np.sqrt(squares))
    a, b = robot.rayleigh
    return a + b * squares


def damping_of_modes(robot: SpatialRobot, modes: StructureModes) -> Real:
    """Compute the damping over mass-normalised modes, ``diag(2 zeta omega) + sum_j c_j b_j b_j^T``, rad/s, (n, n).

    ``b_j`` is the motion of all modes in joint j, about or along the joint's axis; ``c_j`` is the joint's viscous
    damping.

    Raises
    ------
    InputError
        A direction with negative damping: negative joint damping exceeds the damping of the robot.
    """
    damping = np.diag(modal_damping(robot, modes.squares))
    if not robot.has_joint_damping:
        return damping
    directions = {frame.name: drive_direction(frame) for frame in robot.mechanism.frames}
    for joint, spring in zip(robot.joints, modes.structure.springs, strict=True):
        if joint.damping:
            before, after = (part[directions[joint.frame]] for part in spring.motions(modes.structure.positions))
            first, second = spring.nodes
            motion = modes.shapes[:, second] @ after - modes.shapes[:, first] @ before
            damping += joint.damping * np.outer(motion, motion)
    least = float(np.linalg.eigvalsh(damping)[0])
    if least < -1e-9 * float(np.abs(damping).max()):
        raise InputError(
            f"the joints' damping leaves a motion with {least:.3g} 1/s: it must not be negative; "
            "raise damping_nms_per_rad, or the robot's [damping]"
        )
    return damping


def damping_warnings(robot: SpatialRobot, modes: StructureModes) -> tuple[str, ...]:
    """Warn in one sentence if Rayleigh damping, set at low frequencies, is large in high modes."""
    ratios = np.diag(damping_of_modes(robot, modes)) / (2 * np.sqrt(modes.squares))
    large = (modes.frequencies > ROBOT.high_mode) & (ratios > ROBOT.large_damping)
    if not large.any():
        return ()
    return (
        f"Rayleigh damping gives more than {100 * ROBOT.large_damping:.0f} % from {modes.frequencies[large][0]:.0f} Hz "
        f"on, and {int(np.sum(ratios >= 1))} modes are overdamped; two measured ratios at low frequencies do not "
        "determine those of high modes: give a ratio instead",
    )


def frf_at(robot: SpatialRobot, q: Real, frequencies: Real, *, axes: Real | None = None) -> Frf:
    """Compute the receptance at the tool tip from all modes, overdamped modes included; frequencies in Hz."""
    modes = modes_at(robot, q)
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    tip = modes.shapes[:, modes.structure.tip, :3] @ turn
    omega = 2 * np.pi * np.asarray(frequencies, dtype=float)[:, None]
    damping = damping_of_modes(robot, modes)
    if robot.has_joint_damping:
        stiffness = np.eye(len(damping)) * (modes.squares - omega**2)[:, None, :]
        values = tip.T @ np.linalg.solve(stiffness + 1j * omega[:, :, None] * damping, tip.astype(complex))
    else:
        gain = 1 / (modes.squares - omega**2 + 1j * omega * np.diag(damping))
        values = np.einsum("kr,rp,rq->kpq", gain, tip, tip, optimize=True)
    valid = np.ones(len(omega), dtype=bool)
    return Frf(omega[:, 0] / (2 * np.pi), values, TIP, TIP, "receptance", "m/N", valid)


def tool_spring(robot: SpatialRobot) -> ElasticJoint | None:
    """Return the spring that ends at the tool tip in the frame of the tool; None if the tool is rigid."""
    at_tip = (joint for joint in robot.joints if joint.frame == robot.mechanism.tool and joint.nodes[1] == robot.tip)
    return next(at_tip, None)


def housing_node(robot: SpatialRobot) -> int:
    """Return the node of the spindle's housing: the node before the tool's spring, or the tip if the tool is rigid."""
    spring = tool_spring(robot)
    return robot.tip if spring is None else spring.nodes[0]


def with_tool_spring(
    robot: SpatialRobot, lateral: float, axial: float = 0.0, tool_mass: float = ROBOT.tool_mass
) -> SpatialRobot:
    """Return the robot with a compliant tool: ``x_tip = x_spindle + C F`` in the tool frame, ``C = diag(c, c, c_z)``.

    The tool on a fixed spindle vibrates at ``sqrt(1 / (c m)) / (2 pi)`` Hz. If the robot already has a tool spring,
    the compliances are added to it.

    Parameters
    ----------
    robot
        Robot whose tool frame has z along the tool.
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
        raise InputError(f"tool mass {tool_mass!r} kg must be positive, for example {ROBOT.tool_mass}")
    added = np.array([lateral, lateral, axial])
    spring = tool_spring(robot)
    if spring is not None:
        stiffness = np.append(_stiffness(1 / spring.stiffness[:3] + added), spring.stiffness[3:])
        softer = replace(spring, stiffness=stiffness)
        return replace(robot, joints=tuple(softer if joint is spring else joint for joint in robot.joints))
    tip, frame = robot.n_nodes, robot.mechanism.tool
    joint = ElasticJoint(frame, (robot.tip, tip), np.append(_stiffness(added), np.full(3, np.inf)))
    body = LumpedBody(tip, frame, tool_mass, np.zeros(3), np.zeros((3, 3)))
    return replace(robot, joints=(*robot.joints, joint), bodies=(*robot.bodies, body), tip=tip)


def _stiffness(compliance: Real) -> Real:
    rigid = ROBOT.rigid_tool_compliance
    return np.where(compliance > rigid, 1 / np.maximum(compliance, rigid), np.inf)


def cell_structure_at(
    robot: SpatialRobot, q: Real, sensor: Real, *, axes: Real | None = None, highest_frequency: float = ROBOT.cell_band
) -> ModalModel:
    """Compute the modal model with motion at the tip and at a sensor on the spindle, and forces at the tip.

    In every mode the sensor moves by ``t + theta x r`` with the translation and rotation of the tip, or of the node
    before the tool's spring if there is one (Mohammadi & Ahmadi, Fig. 12 a). Modes are real, so that
    ``sum 2 Re(right left^T) = 0``: a step of force gives no step of velocity. Higher and overdamped modes are dropped
    without a residual, because the simulated cell integrates modes. The joints' damping adds to the damping of each
    mode; the coupling of modes that it causes is left out.

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
        Highest undamped natural frequency that is retained.

    Raises
    ------
    InputError
        No damped mode remains.
    """
    modes = modes_at(robot, q)
    turn = np.eye(3) if axes is None else np.asarray(axes, dtype=float)
    tip = modes.shapes[:, modes.structure.tip, :3] @ turn
    housing = modes.shapes[:, housing_node(robot)]
    translation, rotation = housing[:, :3] @ turn, housing[:, 3:] @ turn
    natural, rates = np.sqrt(modes.squares), np.diag(damping_of_modes(robot, modes))
    retained = (natural < 2 * np.pi * highest_frequency) & (rates < 2 * natural) & (rates > 0)
    if not retained.any():
        raise InputError("no damped mode remains for the simulated cell; give the robot damping, or more modes")
    damped = np.sqrt(modes.squares[retained] - rates[retained] ** 2 / 4)
    at_sensor = translation + np.cross(rotation, np.asarray(sensor, dtype=float))
    right = np.hstack([tip, at_sensor])[retained].astype(complex)
    left = tip[retained] / (2j * damped[:, None])
    return ModalModel(-rates[retained] / 2 + 1j * damped, right, left, (*TIP, *HOUSING), TIP)
