"""Robots in space from their files."""

import os
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..kinematics import Mechanism
from ..spatial import SpatialRobot, check_tip
from ..uncertain_robot import RobotUncertainty
from .common_tables import named_postures, rayleigh_of, upwards
from .robot_files import read_as
from .spatial_parts import body_of, frame_of, joint_of, link_of
from .spatial_tables import BodyRow, SpatialFile
from .update_table import left_open, uncertainty_of


@dataclass(frozen=True)
class SpatialCase:
    """A robot in space as its file describes it.

    Parameters
    ----------
    name
        Name of the robot.
    robot
        The robot as a structure and mechanism.
    poses
        Driven joint values by name, rad and (prismatic joints) m.
    repeatability : m
        Pose repeatability after ISO 9283 (RP: radius of the sphere); None: the file does not tell it.
    assumed
        What the file marks as assumed and what decides results: one sentence each, for the warnings of every result.
    uncertainty
        What an update left open of the file's numbers; None: the file was never updated.
    """

    name: str
    robot: SpatialRobot
    poses: dict[str, NDArray[np.float64]]
    repeatability: float | None = None
    assumed: tuple[str, ...] = ()
    uncertainty: RobotUncertainty | None = None


def read_spatial_robot(robot: str | os.PathLike[str]) -> SpatialCase:
    """Read a robot of kind ``spatial``, by path or by name.

    Raises
    ------
    InputError
        No such robot, or frames and nodes that do not fit together.
    FileFormatError
        Not a robot in space, or a key unknown, missing or of the wrong type.
    """
    content = read_as(SpatialFile, robot, "spatial")
    try:
        return _case(content)
    except InputError as error:
        raise InputError(f"{robot}: {error}") from error


def _case(content: SpatialFile) -> SpatialCase:
    nodes = [row.node for row in content.points]
    for node in nodes:
        if nodes.count(node) > 1:
            raise InputError(f"[[points]] place node {node} twice; place it once")
    frames = tuple(frame_of(row) for row in content.frames)
    closures = tuple(closure.frames for closure in content.closures)
    spatial = SpatialRobot(
        mechanism=Mechanism(frames, content.robot.tool_frame, closures),
        joints=tuple(joint_of(row, frames) for row in content.joints),
        links=tuple(link_of(row) for row in content.links),
        bodies=tuple(body_of(row) for row in content.bodies),
        points={row.node: (row.frame, np.array(row.at_m)) for row in content.points},
        tip=content.robot.tip_node,
        rayleigh=rayleigh_of(content.damping),
        damping_ratio=None if content.damping is None else content.damping.ratio,
        gravity=content.robot.gravity_m_per_s2,
        up=upwards(content.robot.up),
    )
    check_tip(spatial)
    poses = named_postures(content.poses, spatial.mechanism)
    _check_masses(content.bodies)
    uncertainty = None if content.update is None else uncertainty_of(content.update)
    assumed = () if content.update is None else left_open(content.update)
    return SpatialCase(content.robot.name, spatial, poses, content.robot.repeatability_m, assumed, uncertainty)


def _check_masses(rows: list[BodyRow]) -> None:
    """A negative mass is what another body of its node has too much; what is left must be one."""
    for number, row in enumerate(rows, start=1):
        left = sum(other.mass_kg for other in rows if other.node == row.node)
        if (row.mass_kg < 0 and left <= -0.5) or row.mass_kg == 0:
            raise InputError(
                f"bodies[{number}].mass_kg must be above 0, not {row.mass_kg!r}; a negative mass stands for what "
                f"another body of node {row.node} has too much, and {left:g} kg are left there"
            )
