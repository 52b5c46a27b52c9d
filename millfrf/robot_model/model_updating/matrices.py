"""A robot in one posture as matrices that its free parameters scale, so that no new assembly is needed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import InputError, Real

from ..finite_elements.structure import Structure, coordinate_basis, cross_matrix, mass_matrix, stiffness_matrix
from ..identification.elastic_parameters import GROUPS
from ..kinematics.mechanism import drive_direction
from ..settings import UPDATE
from ..spatial.spatial_modes import housing_node
from ..spatial.spatial_robot import SpatialRobot, structure_at
from .changed_structure import (
    FOUNDATION,
    UpdateParameter,
    carrier_node,
    damping_unit,
    on_springs,
    place_of_node,
    tool_node,
)


@dataclass(frozen=True)
class PostureSystem:
    """Matrices of a robot in one posture over n independent coordinates."""

    stiffness: Real  # (n, n): part of the stiffness that no free parameter scales
    mass: Real  # (n, n): mass as in the file
    # for each parameter, rows F (rank, n): F^T F is the part of the file's stiffness that the parameter scales;
    # for masses and inertias, the motion (6, n) of the node that carries them
    factors: tuple[Real | None, ...]
    damping_units: Real  # (n_parameters,), N m s/rad or N s/m: viscous damping of a ratio of 1 in the joint
    own_damping: Real  # (n_parameters,), N m s/rad or N s/m: viscous damping of the joints in the file
    observed: Real  # (6, n): motion of tip and housing sensor along the channels' axes, in the order of TIP, HOUSING
    blocks: dict[int, Real]  # mass matrices (6, 6) of the bodies that a parameter scales, by the parameter's index
    tool: Real  # (3, 3): axes of the tool frame as columns, in the channels' axes
    base_axes: Real  # (3, 3): axes of the tool frame as columns, in the base frame
    arms: tuple[Real, Real]  # m, tool frame: places from the tip of the nodes that carry a payload and a tool's mass
    ratio: float | None  # the robot's damping, as in SpatialRobot
    rayleigh: tuple[float, float]

    @property
    def tool_arm(self) -> Real:
        """Return the arm of the tool's mass from the node that carries it, base frame, m, (3,)."""
        return self.base_axes @ -self.arms[1]


def posture_system(
    robot: SpatialRobot,
    parameters: Sequence[UpdateParameter],
    q: Real,
    axes: Real,
    sensor: Real | None = None,
) -> PostureSystem:
    """Assemble the matrices of a robot in one posture, which its free parameters scale afterwards.

    Parameters
    ----------
    q : (n_moving,), rad or m
        Joint values of the posture.
    axes : (3, 3)
        Columns: X, Y, Z of the channels in the base frame.
    sensor : (3,), m, or None
        Housing sensor from the tip, in the channels' axes; None: at the tip's place.
    """
    if not robot.bodies and not any(link.section for link in robot.links):
        raise InputError("this robot's file gives stiffness but no masses: FRFs cannot update it; add [[bodies]]")
    if any(parameter.kind == "base" for parameter in parameters):
        # the base's springs must exist to be scaled: as good as rigid, in the directions that are free
        rigid = np.array([1.0, 1.0, np.inf, 1.0, 1.0, np.inf]) / UPDATE.least_compliance
        grounded = on_springs(robot, rigid)
    else:
        grounded = robot
    structure = structure_at(grounded, q)
    basis = coordinate_basis(structure)
    factors = tuple(_factor(grounded, structure, parameter, basis) for parameter in parameters)
    weight = stiffness_matrix(replace(structure, springs=(), beams=(), drives=()))
    axes = np.asarray(axes, dtype=float)
    attitude = grounded.mechanism.transforms(q)[grounded.mechanism.index(grounded.mechanism.tool), :3, :3]
    units, own = _dampings(grounded, parameters)
    return PostureSystem(
        basis.T @ weight @ basis + _unscaled_stiffness(grounded, structure, parameters, basis),
        basis.T @ mass_matrix(structure) @ basis,
        factors,
        units,
        own,
        _observed(grounded, basis, axes, sensor),
        _blocks(structure, parameters),
        axes.T @ attitude,
        attitude,
        (place_of_node(robot, carrier_node(robot)), place_of_node(robot, tool_node(robot))),
        robot.damping_ratio,
        robot.rayleigh,
    )


def _observed(robot: SpatialRobot, basis: Real, axes: Real, sensor: Real | None) -> Real:
    """Compute the motion of tip and housing sensor along the channels' axes over the n coordinates, (6, n)."""
    tip, spindle = (basis[6 * node : 6 * node + 6] for node in (robot.tip, housing_node(robot)))
    arm = np.zeros(3) if sensor is None else np.asarray(sensor, dtype=float)
    housing = axes.T @ spindle[:3] - cross_matrix(arm) @ axes.T @ spindle[3:]
    return np.vstack([axes.T @ tip[:3], housing])


def _factor(robot: SpatialRobot, structure: Structure, parameter: UpdateParameter, basis: Real) -> Real | None:
    """Return rows F, where ``F^T F`` is the stiffness that a parameter scales; None for damping and the tool.

    For masses and inertias return the motion (6, n) of the node that carries them.
    """
    kind = parameter.kind
    if kind == "links":
        beams = stiffness_matrix(replace(structure, springs=(), drives=(), weight=None))
        values, vectors = scipy.linalg.eigh(basis.T @ beams @ basis)
        positive = values > 1e-12 * values[-1]
        return np.asarray((vectors[:, positive] * np.sqrt(values[positive])).T)
    if kind in ("payload", "tool mass", "body", "inertia"):
        if kind in ("body", "inertia"):
            node = structure.bodies[parameter.axis].node
        else:
            node = tool_node(robot) if kind == "tool mass" else carrier_node(robot)
        return np.asarray(basis[6 * node : 6 * node + 6])
    if kind == "base":
        group = ("tilting", "radial")[parameter.axis]
        return _joint_rows(robot, structure, FOUNDATION, group, basis, unit=True)
    if kind in ("stiffness", "joint damping"):
        return _joint_rows(robot, structure, parameter.frame, parameter.group, basis, unit=kind != "stiffness")
    return None


def _blocks(structure: Structure, parameters: Sequence[UpdateParameter]) -> dict[int, Real]:
    blocks = {}
    for i, parameter in enumerate(parameters):
        if parameter.kind in ("body", "inertia"):
            body = structure.bodies[parameter.axis]
            blocks[i] = mass_block(body.mass if parameter.kind == "body" else 0.0, body.centre)
            blocks[i][3:, 3:] += body.inertia
    return blocks


def _joint_rows(robot: SpatialRobot, structure: Structure, frame: str, group: str, basis: Real, *, unit: bool) -> Real:
    """Compute the relative motion in the joints at a frame, in a group of directions, over the coordinates.

    It is multiplied by the square root of the stiffness unless ``unit`` is true. An empty group stands for the joint's
    motion along or about its axis.
    """
    rows = []
    own = robot.mechanism.frames[robot.mechanism.index(frame)]
    places = list(GROUPS[group] if group else (drive_direction(own),))
    for joint, spring in zip(robot.joints, structure.springs, strict=True):
        if joint.frame == frame:
            before, after = spring.motions(structure.positions)
            first, second = (basis[6 * node : 6 * node + 6] for node in spring.nodes)
            moved = (after @ second - before @ first)[places]
            rows.append(moved if unit else np.sqrt(joint.stiffness[places])[:, None] * moved)
    return np.vstack(rows)


def _unscaled_stiffness(
    robot: SpatialRobot, structure: Structure, parameters: Sequence[UpdateParameter], basis: Real
) -> Real:
    """Assemble the stiffness of the springs and beams that no parameter scales, (n, n)."""
    scaled = {(parameter.frame, parameter.group) for parameter in parameters if parameter.kind == "stiffness"}
    if any(parameter.kind == "base" for parameter in parameters):
        scaled |= {(FOUNDATION, "tilting"), (FOUNDATION, "radial")}
    springs = []
    for joint, spring in zip(robot.joints, structure.springs, strict=True):
        stiffness = joint.stiffness.copy()
        for group, places in GROUPS.items():
            if (joint.frame, group) in scaled:
                stiffness[list(places)] = 0.0
        springs.append(replace(spring, stiffness=stiffness))
    beams = () if any(parameter.kind == "links" for parameter in parameters) else structure.beams
    unscaled = replace(structure, springs=tuple(springs), beams=beams, weight=None)
    return np.asarray(basis.T @ stiffness_matrix(unscaled) @ basis)


def _dampings(robot: SpatialRobot, parameters: Sequence[UpdateParameter]) -> tuple[Real, Real]:
    units, own = np.zeros(len(parameters)), np.zeros(len(parameters))
    for i, parameter in enumerate(parameters):
        if parameter.kind == "joint damping":
            joint = next(joint for joint in robot.joints if joint.frame == parameter.frame)
            units[i], own[i] = damping_unit(robot, joint), joint.damping
    return units, own


def mass_block(mass: float, arm: Real) -> Real:
    """Compute the mass matrix (6, 6) over a node's motion of a point mass (kg) at ``arm`` (3,), m, from the node."""
    shift = np.hstack([np.eye(3), -cross_matrix(arm)])
    return np.asarray(mass * shift.T @ shift)
