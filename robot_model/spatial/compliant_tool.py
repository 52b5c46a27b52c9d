"""A tool that gives way: a spring between the spindle and the tool tip, with the tool's mass on it."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from .spatial_robot import ElasticJoint, LumpedBody, SpatialRobot

Real = NDArray[np.float64]

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
