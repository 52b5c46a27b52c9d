"""A robot in one posture as matrices that its freed numbers scale: response and derivatives without assembly."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from millfrf.core import HOUSING, TIP, InputError, Real

from ..finite_elements.structure import Structure, coordinate_basis, cross_matrix, mass_matrix, stiffness_matrix
from ..kinematics.mechanism import drive_direction
from ..spatial.spatial_modes import housing_node
from ..spatial.spatial_robot import SpatialRobot, structure_at
from .changed_structure import (
    FOUNDATION,
    GROUPS,
    LEAST_COMPLIANCE,
    UpdateParameter,
    carrier_node,
    damping_unit,
    on_springs,
    payload_centre,
    place_of_node,
    tool_node,
)


@dataclass(frozen=True)
class PostureSystem:
    """Matrices of a robot in one posture over independent coordinates, n of them.

    Parameters
    ----------
    stiffness, mass : (n, n)
        What no freed number scales: bodies, beams' mass, weight.
    factors
        For each parameter the rows F of its part ``F^T F``: of the stiffness as the file has it, (rank, n); for a
        payload and a tool mass the motion of the node that carries it, (6, n).
    damping_units, own_damping : (n_parameters,), N m s/rad or N s/m
        Viscous damping that a joint's own ratio of 1 stands for, and the joints' own damping in the file.
    observed : (n_labels, n)
        Motion of the degrees of freedom ``labels`` over the coordinates.
    tool : (3, 3)
        Axes of the tool frame, as columns in the axes of the channels.
    base_axes : (3, 3)
        Axes of the tool frame, as columns in the base frame.
    blocks
        Mass matrices (6, 6) of the bodies whose factors a parameter scales, by its number.
    arms : two of (3,), m
        Places of the nodes that carry a payload and a tool's mass, from the tip in the tool frame.
    centre : (3,), m
        Place from which a payload's place is told.
    ratio, rayleigh
        The robot's own damping, as in :class:`millfrf.robot_model.SpatialRobot`.
    """

    stiffness: Real
    mass: Real
    factors: tuple[Real | None, ...]
    damping_units: Real
    own_damping: Real
    observed: Real
    labels: tuple[str, ...]
    blocks: dict[int, Real]
    tool: Real
    base_axes: Real
    arms: tuple[Real, Real]
    centre: Real
    ratio: float | None
    rayleigh: tuple[float, float]

    @property
    def tool_arm(self) -> Real:
        """Arm of the tool's mass from its node, base frame, m."""
        return self.base_axes @ -self.arms[1]


def posture_system(
    robot: SpatialRobot,
    parameters: Sequence[UpdateParameter],
    q: Real,
    axes: Real,
    sensor: Real | None = None,
) -> PostureSystem:
    """Assemble a robot's matrices in a posture once.

    Parameters
    ----------
    robot
        The robot as its file has it.
    parameters
        Numbers that are freed.
    q : (n_moving,), rad or m
        Joint values of the posture.
    axes : (3, 3)
        Columns: X, Y, Z of the channels in the base frame.
    sensor : (3,), m, or None
        Housing sensor from the tip, in the channels' axes; None: at the tip's place.

    Raises
    ------
    InputError
        A robot without masses.
    """
    if not robot.bodies and not any(link.section for link in robot.links):
        raise InputError("this robot's file gives stiffness but no masses: FRFs cannot update it; add [[bodies]]")
    free_base = any(one.kind == "base" for one in parameters)
    stiff = np.array([1.0, 1.0, np.inf, 1.0, 1.0, np.inf]) / LEAST_COMPLIANCE
    whole = on_springs(robot, stiff) if free_base else robot
    structure = structure_at(whole, q)
    basis = coordinate_basis(structure)
    factors = tuple(_factor(whole, structure, one, basis) for one in parameters)
    rest = basis.T @ _stiffness_of(structure, weight=True) @ basis
    rest = rest + _unfreed(whole, structure, parameters, basis)
    turned = np.asarray(axes, dtype=float)
    attitude = whole.mechanism.transforms(q)[whole.mechanism.index(whole.mechanism.tool), :3, :3]
    units, own = _dampings(whole, parameters)
    return PostureSystem(
        rest,
        basis.T @ mass_matrix(structure) @ basis,
        factors,
        units,
        own,
        _observed(whole, basis, turned, sensor),
        (*TIP, *HOUSING),
        _blocks(structure, parameters),
        turned.T @ attitude,
        attitude,
        (place_of_node(robot, carrier_node(robot)), place_of_node(robot, tool_node(robot))),
        payload_centre(robot),
        robot.damping_ratio,
        robot.rayleigh,
    )


def _observed(robot: SpatialRobot, basis: Real, axes: Real, sensor: Real | None) -> Real:
    """Motion of the tip and of the housing's sensor in the channels' axes, (6, n)."""
    tip, held = (basis[6 * node : 6 * node + 6] for node in (robot.tip, housing_node(robot)))
    arm = np.zeros(3) if sensor is None else np.asarray(sensor, dtype=float)
    housing = axes.T @ held[:3] - cross_matrix(arm) @ axes.T @ held[3:]
    return np.vstack([axes.T @ tip[:3], housing])


def _factor(robot: SpatialRobot, structure: Structure, one: UpdateParameter, basis: Real) -> Real | None:
    """Rows F with ``F^T F`` the stiffness that a parameter scales, or the motion of the node that it loads."""
    if one.kind == "links":
        return _rows(basis.T @ _stiffness_of(structure, beams=True) @ basis)
    if one.kind in ("payload", "tool mass"):
        node = tool_node(robot) if one.kind == "tool mass" else carrier_node(robot)
        return np.asarray(basis[6 * node : 6 * node + 6])
    if one.kind in ("body", "inertia"):
        node = structure.bodies[one.axis].node
        return np.asarray(basis[6 * node : 6 * node + 6])
    if one.kind in ("stiffness", "joint damping", "base"):
        frame = FOUNDATION if one.kind == "base" else one.frame
        group = ("tilting", "radial")[one.axis] if one.kind == "base" else one.group
        return _joint_rows(robot, structure, frame, group, basis, unit=one.kind != "stiffness")
    return None


def _blocks(structure: Structure, parameters: Sequence[UpdateParameter]) -> dict[int, Real]:
    found = {}
    for i, one in enumerate(parameters):
        if one.kind in ("body", "inertia"):
            body = structure.bodies[one.axis]
            found[i] = mass_block(body.mass if one.kind == "body" else 0.0, body.centre)
            found[i][3:, 3:] += body.inertia
    return found


def _joint_rows(robot: SpatialRobot, structure: Structure, frame: str, group: str, basis: Real, *, unit: bool) -> Real:
    rows = []
    own = robot.mechanism.frames[robot.mechanism.index(frame)]
    places = GROUPS[group] if group else (drive_direction(own),)
    for joint, spring in zip(robot.joints, structure.springs, strict=True):
        if joint.frame == frame:
            before, after = spring.motions(structure.positions)
            first, second = (basis[6 * node : 6 * node + 6] for node in spring.nodes)
            moved = (after @ second - before @ first)[list(places)]
            rows.append(moved if unit else np.sqrt(joint.stiffness[list(places)])[:, None] * moved)
    return np.vstack(rows)


def _unfreed(robot: SpatialRobot, structure: Structure, parameters: Sequence[UpdateParameter], basis: Real) -> Real:
    """Stiffness of springs and beams that no parameter scales."""
    scaled = {(one.frame, one.group) for one in parameters if one.kind == "stiffness"}
    if any(one.kind == "base" for one in parameters):
        scaled |= {(FOUNDATION, "tilting"), (FOUNDATION, "radial")}
    springs = []
    for joint, spring in zip(robot.joints, structure.springs, strict=True):
        left = joint.stiffness.copy()
        for group, places in GROUPS.items():
            if (joint.frame, group) in scaled:
                left[list(places)] = 0.0
        springs.append(replace(spring, stiffness=left))
    beams = () if any(one.kind == "links" for one in parameters) else structure.beams
    still = Structure(structure.positions, tuple(springs), beams, (), (), structure.tip, drives=structure.drives)
    return np.asarray(basis.T @ stiffness_matrix(still) @ basis)


def _stiffness_of(structure: Structure, *, weight: bool = False, beams: bool = False) -> Real:
    part = Structure(
        structure.positions,
        (),
        structure.beams if beams else (),
        (),
        (),
        structure.tip,
        structure.weight if weight else None,
    )
    return stiffness_matrix(part)


def _rows(matrix: Real) -> Real:
    """F of a positive semi-definite matrix ``F^T F``, with as many rows as it has rank."""
    values, vectors = scipy.linalg.eigh(matrix)
    kept = values > 1e-12 * values[-1]
    return np.asarray((vectors[:, kept] * np.sqrt(values[kept])).T)


def _dampings(robot: SpatialRobot, parameters: Sequence[UpdateParameter]) -> tuple[Real, Real]:
    units, own = np.zeros(len(parameters)), np.zeros(len(parameters))
    for i, one in enumerate(parameters):
        if one.kind == "joint damping":
            joint = next(joint for joint in robot.joints if joint.frame == one.frame)
            units[i], own[i] = damping_unit(robot, joint), joint.damping
    return units, own


def mass_block(mass: float, arm: Real) -> Real:
    """Mass matrix of a point mass over its node, (6, 6)."""
    shift = np.hstack([np.eye(3), -cross_matrix(arm)])
    return np.asarray(mass * shift.T @ shift)
