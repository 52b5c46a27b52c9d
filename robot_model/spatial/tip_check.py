"""Whether the tip node of a robot stands where its tool frame is."""

from dataclasses import replace

import numpy as np

from foundation import InputError

from .robot_check import node_bodies
from .spatial_robot import SpatialRobot, structure_at


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
