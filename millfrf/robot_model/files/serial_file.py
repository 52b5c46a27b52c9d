"""Serial robots from their files: joints and bodies in a row; nodes are built when the file is read."""

import os
from math import radians

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from millfrf.core import InputError, Real

from ..serial_chains.serial_chain import BASE, RigidPart, SerialChain, SerialJoint, place_of, spatial_robot
from .common_tables import (
    BearingKeys,
    DampingTable,
    InertiaKeys,
    LimitKeys,
    PoseRow,
    SpatialCase,
    UpdateTable,
    Vector,
    damping_and_gravity,
    spatial_case,
)
from .robot_files import SpatialHeadTable, Table, read_as


class PlaceTable(Table):
    """A place and its axes, given in the axes before it.

    Parameters
    ----------
    at_m : m
        Place in the axes before: of the base or the joint before; of the cell, for the base.
    turned_deg : deg
        Turns about the fixed x, y and z of the axes before, one after the other (roll, pitch, yaw of URDF).
    """

    at_m: Vector = (0.0, 0.0, 0.0)
    turned_deg: Vector = (0.0, 0.0, 0.0)


class StiffnessTable(BearingKeys):
    """Stiffness of gear and bearing: ``drive`` along the joint's own motion, the other keys across it.

    Parameters
    ----------
    drive_nm_per_rad : N m/rad
        Stiffness about the axis of a revolute joint; needed there.
    drive_n_per_m : N/m
        Stiffness along the axis of a prismatic joint; needed there.
    turning_nm_per_rad : N m/rad
        Stiffness of a prismatic joint against turning about its axis; left out: rigid.
    """

    drive_nm_per_rad: float | None = Field(None, gt=0)
    drive_n_per_m: float | None = Field(None, gt=0)


class SerialJointRow(PlaceTable, LimitKeys):
    """A row ``[[joints]]``, from the base to the tip.

    Parameters
    ----------
    name
        Name of the joint.
    motion
        ``revolute`` or ``prismatic``.
    axis
        Direction of the axis in the joint's own axes; its length is not used.
    stiffness
        Stiffness of gear and bearing.
    """

    name: str
    motion: str = "revolute"
    axis: Vector = (0.0, 0.0, 1.0)
    stiffness: StiffnessTable


class MassTable(InertiaKeys):
    """A rigid body: mass, centre, inertia.

    Parameters
    ----------
    mass_kg : kg
        Mass of the body.
    """

    mass_kg: float = Field(gt=0)


class SerialBodyRow(MassTable):
    """A row ``[[bodies]]``: a rigid body that moves behind a joint, in its axes.

    Parameters
    ----------
    name
        Name of the body.
    joint
        Joint behind which it moves; ``base``: it stands still.
    """

    name: str
    joint: str


class SerialFile(BaseModel):
    """A robot file of kind ``serial``.

    Parameters
    ----------
    robot
        Name and kind of the robot, gravity and repeatability.
    base
        Place of the first joint's base in the cell.
    joints
        Joints from the base to the tip.
    bodies
        Rigid bodies; without masses a robot has statics only.
    flange
        Flange in the axes of the last joint.
    tool
        Tip of the tool in the axes of the flange, z along the tool.
    spindle
        Mass of spindle and tool, in the axes of the flange; it is used only with ``bodies`` that move.
    damping
        Damping of the structure.
    poses
        Named postures; the first is the default.
    update
        Result of ``millfrf robot update``: the changed numbers and their covariance; written by it.
    """

    model_config = ConfigDict(extra="forbid")

    robot: SpatialHeadTable
    base: PlaceTable | None = None
    joints: list[SerialJointRow] = Field(min_length=1)
    bodies: list[SerialBodyRow] = []
    flange: PlaceTable | None = None
    tool: PlaceTable | None = None
    spindle: MassTable | None = None
    damping: DampingTable | None = None
    poses: list[PoseRow] = []
    update: UpdateTable | None = None


def read_serial_robot(robot: str | os.PathLike[str]) -> SpatialCase:
    """Read a robot of kind ``serial``, by path or by name."""
    return read_as(SerialFile, robot, "serial", _case)


def _case(content: SerialFile) -> SpatialCase:
    flange = _place(content.flange)
    joints = tuple(_joint(row) for row in content.joints)
    parts = [_part(row, row.name, row.joint, np.eye(4)) for row in content.bodies]
    # a robot of which only the spindle has mass would have modes of the spindle alone
    if content.spindle is not None and any(row.joint != BASE for row in content.bodies):
        parts.append(_part(content.spindle, "spindle", joints[-1].name, flange))
    chain = SerialChain(joints, tuple(parts), _place(content.base), flange, _place(content.tool))
    robot = spatial_robot(chain, **damping_and_gravity(content.robot, content.damping))
    if content.update is not None:
        robot = content.update.applied_to(robot)
    return spatial_case(content.robot, robot, content.poses, content.update, _assumed(content))


def _assumed(content: SerialFile) -> tuple[str, ...]:
    """Return one warning for each kind of assumed number (stiffness, masses, damping) that results depend on."""
    joints = [row.name for row in content.joints if "assumed" in row.stiffness.source]
    bodies = [row.name for row in content.bodies if "assumed" in row.source]
    bodies += ["spindle"] if content.spindle is not None and "assumed" in content.spindle.source else []
    warnings = []
    if joints:
        warnings.append(
            f"the stiffness of joints {', '.join(joints)} is assumed, not known: frequencies, deflections and depth "
            "limits may be off by a factor of two or more until it is measured"
        )
    if bodies:
        warnings.append(f"mass and inertia of {', '.join(bodies)} are assumed, not known")
    if content.damping is not None and "assumed" in content.damping.source:
        warnings.append("damping is assumed, not known: depth limits are proportional to it")
    if not any(row.joint != BASE for row in content.bodies):
        warnings.append(
            "the file gives no [[bodies]] that move: it has statics, not modes; a spindle alone is no robot's mass"
        )
    return tuple(warnings)


def _place(row: PlaceTable | None) -> Real:
    return np.eye(4) if row is None else place_of(row.at_m, [radians(angle) for angle in row.turned_deg])


def _joint(row: SerialJointRow) -> SerialJoint:
    lower, upper = row.limits(f"joint {row.name}", row.motion)
    return SerialJoint(row.name, row.motion, _place(row), np.array(row.axis), lower, upper, _stiffness(row))


def _stiffness(row: SerialJointRow) -> Real:
    """Return a joint's six stiffnesses; the drive's stiffness must be given exactly once, in the unit of the motion."""
    table, sliding = row.stiffness, row.motion == "prismatic"
    revolute, prismatic = table.drive_nm_per_rad, table.drive_n_per_m
    drive, wrong_unit = (prismatic, revolute) if sliding else (revolute, prismatic)
    twice = table.axial_n_per_m if sliding else table.turning_nm_per_rad
    if drive is None or wrong_unit is not None or twice is not None:
        raise InputError(
            f"joint {row.name}: its stiffness along its own motion is missing or given in another unit; give "
            f"{'drive_n_per_m' if sliding else 'drive_nm_per_rad'} of this {row.motion} joint in [joints.stiffness], "
            "once"
        )
    stiffness = table.stiffness()
    stiffness[2 if sliding else 5] = drive
    return stiffness


def _part(row: MassTable, name: str, joint: str, frame: Real) -> RigidPart:
    inertia, turn = row.inertia(f"body {name}"), frame[:3, :3]
    centre = turn @ np.array(row.centre_m) + frame[:3, 3]
    return RigidPart(name, joint, row.mass_kg, centre, turn @ inertia @ turn.T)
