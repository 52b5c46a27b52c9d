"""Serial robots from their files: joints and bodies in a row; nodes are built, not numbered."""

import os
from math import inf, radians

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from millfrf.core import InputError, Real

from ..kinematics.joint_values import LARGEST_TRAVEL
from ..serial_chains.chain_file import spatial_robot
from ..serial_chains.serial_chain import BASE, RigidPart, SerialChain, SerialJoint, inertia_fault, place_of, symmetric
from ..spatial.spatial_modes import check_tip
from .common_tables import (
    Damping,
    Pose,
    UpdateTable,
    named_postures,
    rayleigh_of,
    uncertainty_of,
    upwards,
    with_late_numbers,
)
from .robot_files import Table, read_as
from .spatial_file import SpatialCase

Vector = tuple[float, float, float]
Inertia = Vector | tuple[float, float, float, float, float, float]


class _Head(Table):
    """The table ``[robot]``.

    Parameters
    ----------
    name
        Name of the robot.
    kind
        ``serial``, ``spatial`` or ``planar``: which tables the file has.
    gravity_m_per_s2 : m/s^2
        Gravity as a stiffness of the structure; 0: left out.
    up
        Axis of the base against the weight: ``[0, 0, 1]`` stands on the floor, ``[0, 0, -1]`` hangs from a ceiling.
    repeatability_m : m
        Pose repeatability after ISO 9283 (RP), such as 6e-5 for 0.06 mm.
    """

    name: str
    kind: str
    gravity_m_per_s2: float = Field(0.0, ge=0, le=30)
    up: Vector = (0.0, 0.0, 1.0)
    repeatability_m: float | None = Field(None, ge=1e-6, le=5e-3)


class _Place(Table):
    """A place and its axes, told in the axes before it.

    Parameters
    ----------
    at_m : m
        Place in the axes before: of the base or the joint before; of the cell, for the base.
    turned_deg : deg
        Turns about the fixed x, y and z of the axes before, one after the other (roll, pitch, yaw of URDF).
    """

    at_m: Vector = (0.0, 0.0, 0.0)
    turned_deg: Vector = (0.0, 0.0, 0.0)


class _Stiffness(Table):
    """``drive``: along the joint's own motion; the rest gives way across it.

    Parameters
    ----------
    drive_nm_per_rad : N m/rad
        Stiffness about the axis of a revolute joint; needed there.
    drive_n_per_m : N/m
        Stiffness along the axis of a prismatic joint; needed there.
    radial_n_per_m : N/m
        Stiffness of the bearing across the joint's axis; left out: rigid.
    axial_n_per_m : N/m
        Stiffness of the bearing along the joint's axis; left out: rigid.
    tilting_nm_per_rad : N m/rad
        Stiffness of the bearing against tilting of the axis; left out: rigid.
    turning_nm_per_rad : N m/rad
        Stiffness of a prismatic joint against turning about its axis; left out: rigid.
    """

    drive_nm_per_rad: float | None = Field(None, gt=0)
    drive_n_per_m: float | None = Field(None, gt=0)
    radial_n_per_m: float | None = Field(None, gt=0)
    axial_n_per_m: float | None = Field(None, gt=0)
    tilting_nm_per_rad: float | None = Field(None, gt=0)
    turning_nm_per_rad: float | None = Field(None, gt=0)


class _Joint(_Place):
    """A row ``[[joints]]``, from the base to the tip.

    Parameters
    ----------
    name
        Name of the joint.
    motion
        ``revolute`` or ``prismatic``.
    axis
        Direction of the axis in the joint's own axes; its length does not count.
    limits_deg : deg
        Least and largest angle of a revolute joint; left out: none.
    limits_m : m
        Least and largest travel of a prismatic joint; left out: none.
    stiffness
        Stiffness of gear and bearing.
    """

    name: str
    motion: str = "revolute"
    axis: Vector = (0.0, 0.0, 1.0)
    limits_deg: tuple[float, float] | None = None
    limits_m: tuple[float, float] | None = None
    stiffness: _Stiffness


class _Mass(Table):
    """A rigid body: mass, centre, inertia.

    Parameters
    ----------
    mass_kg : kg
        Mass of the body.
    centre_m : m
        Centre of mass.
    inertia_kg_m2 : kg m^2
        Inertia about the centre of mass: ``xx yy zz``, or ``xx yy zz xy xz yz`` with the signs of the matrix's entries.
    """

    mass_kg: float = Field(gt=0)
    centre_m: Vector = (0.0, 0.0, 0.0)
    inertia_kg_m2: Inertia = (0.0, 0.0, 0.0)


class _Body(_Mass):
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
        The robot as a whole.
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
        Mass of spindle and tool, in the axes of the flange; without ``bodies`` that move it does not count.
    damping
        Damping of the structure.
    poses
        Named postures; the first is the default.
    update
        What ``millfrf robot update`` changed and left open; written by it.
    """

    model_config = ConfigDict(extra="forbid")

    robot: _Head
    base: _Place | None = None
    joints: list[_Joint] = Field(min_length=1)
    bodies: list[_Body] = []
    flange: _Place | None = None
    tool: _Place | None = None
    spindle: _Mass | None = None
    damping: Damping | None = None
    poses: list[Pose] = []
    update: UpdateTable | None = None


def read_serial_robot(robot: str | os.PathLike[str]) -> SpatialCase:
    """Read a robot of kind ``serial``, by path or by name.

    Raises
    ------
    InputError
        No such robot, or joints and bodies that do not fit together.
    FileFormatError
        Not a serial robot, or a key unknown, missing or of the wrong type.
    """
    content = read_as(SerialFile, robot, "serial")
    try:
        return _case(content)
    except InputError as error:
        raise InputError(f"{robot}: {error}") from error


def _case(content: SerialFile) -> SpatialCase:
    flange = _place(content.flange)
    joints = tuple(_joint(row) for row in content.joints)
    parts = [_part(row, row.name, row.joint, np.eye(4)) for row in content.bodies]
    if content.spindle is not None and any(row.joint != BASE for row in content.bodies):
        parts.append(_part(content.spindle, "spindle", joints[-1].name, flange))
    chain = SerialChain(joints, tuple(parts), _place(content.base), flange, _place(content.tool))
    built = spatial_robot(
        chain,
        rayleigh=rayleigh_of(content.damping),
        damping_ratio=None if content.damping is None else content.damping.ratio,
        gravity=content.robot.gravity_m_per_s2,
        up=upwards(content.robot.up),
    )
    if content.update is not None:
        built = with_late_numbers(built, content.update)
    check_tip(built)
    poses = named_postures(content.poses, built.mechanism)
    uncertainty = None if content.update is None else uncertainty_of(content.update)
    return SpatialCase(content.robot.name, built, poses, content.robot.repeatability_m, _assumed(content), uncertainty)


def _assumed(content: SerialFile) -> tuple[str, ...]:
    """One sentence for what was assumed and decides results: stiffness, masses, damping."""
    joints = [row.name for row in content.joints if "assumed" in row.stiffness.source]
    bodies = [row.name for row in content.bodies if "assumed" in row.source]
    bodies += ["spindle"] if content.spindle is not None and "assumed" in content.spindle.source else []
    found = []
    if joints:
        found.append(
            f"the stiffness of joints {', '.join(joints)} is assumed, not known: frequencies, deflections and depth "
            "limits may be off by a factor of two or more until it is measured"
        )
    if bodies:
        found.append(f"mass and inertia of {', '.join(bodies)} are assumed, not known")
    if content.damping is not None and "assumed" in content.damping.source:
        found.append("damping is assumed, not known: depth limits are proportional to it")
    if not any(row.joint != BASE for row in content.bodies):
        found.append(
            "the file gives no [[bodies]] that move: it has statics, not modes; a spindle alone is no robot's mass"
        )
    return tuple(found)


def _place(row: _Place | None) -> Real:
    if row is None:
        return np.eye(4)
    return place_of(row.at_m, [radians(angle) for angle in row.turned_deg])


def _joint(row: _Joint) -> SerialJoint:
    lower, upper = _limits(row)
    return SerialJoint(row.name, row.motion, _place(row), np.array(row.axis), lower, upper, _stiffness(row))


def _limits(row: _Joint) -> tuple[float, float]:
    """Limits in rad or m, by the joint's motion."""
    sliding = row.motion == "prismatic"
    given, wrong, right = (
        (row.limits_m, row.limits_deg, "limits_m") if sliding else (row.limits_deg, row.limits_m, "limits_deg")
    )
    if wrong is not None:
        raise InputError(f"joint {row.name}: limits {list(wrong)} of a {row.motion} joint; give {right}")
    if given is None:
        return -inf, inf
    if not sliding:
        return radians(given[0]), radians(given[1])
    if max(map(abs, given)) > LARGEST_TRAVEL:
        raise InputError(f"joint {row.name}: limits_m = {list(given)}: give metres, at most {LARGEST_TRAVEL:g}")
    return given


def _stiffness(row: _Joint) -> Real:
    """What is left out across the axis is rigid; along the joint's own motion a number is needed."""
    given, sliding = row.stiffness, row.motion == "prismatic"
    own, other = (
        (given.drive_n_per_m, given.drive_nm_per_rad) if sliding else (given.drive_nm_per_rad, given.drive_n_per_m)
    )
    key = "drive_n_per_m" if sliding else "drive_nm_per_rad"
    clash = given.axial_n_per_m if sliding else given.turning_nm_per_rad
    if own is None or other is not None or clash is not None:
        raise InputError(
            f"joint {row.name}: its stiffness along its own motion is missing or given in another unit; give {key} of "
            f"this {row.motion} joint in [joints.stiffness], once"
        )
    radial, axial, tilting, turning = (
        inf if value is None else value
        for value in (given.radial_n_per_m, given.axial_n_per_m, given.tilting_nm_per_rad, given.turning_nm_per_rad)
    )
    axial, turning = (own, turning) if sliding else (axial, own)
    return np.array([radial, radial, axial, tilting, tilting, turning])


def _part(row: _Mass, name: str, joint: str, frame: Real) -> RigidPart:
    inertia = symmetric(row.inertia_kg_m2)
    fault = inertia_fault(inertia)
    if fault is not None:
        raise InputError(f"body {name}: inertia_kg_m2 = {list(row.inertia_kg_m2)}: {fault}")
    turn = frame[:3, :3]
    centre = turn @ np.array(row.centre_m) + frame[:3, 3]
    return RigidPart(name, joint, row.mass_kg, centre, turn @ inertia @ turn.T)
