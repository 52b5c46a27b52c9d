"""Nodes of the rotors of a robot's drives: each stands at its joint, between the body before it and the gear."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..finite_elements import Drive, Spring
from ..kinematics import drive_direction

if TYPE_CHECKING:
    from .spatial_robot import SpatialRobot

Real = NDArray[np.float64]


def with_rotors(
    robot: SpatialRobot, springs: tuple[Spring, ...], extra: list[Real], n_places: int
) -> tuple[tuple[Spring, ...], tuple[Drive, ...]]:
    """Give the joints' springs, those with a drive beginning at its rotor, and the rotors.

    Parameters
    ----------
    robot
        Robot whose joints are placed.
    springs
        Its joints' springs from body to body, in the order of its joints.
    extra
        Places (1, 3), m, of nodes behind the robot's own; those of the rotors are added.
    n_places
        How many nodes the robot has of its own.
    """
    behind, drives = [], []
    for joint, spring in zip(robot.joints, springs, strict=True):
        if joint.drive is None:
            behind.append(spring)
            continue
        direction = drive_direction(robot.mechanism.frames[robot.mechanism.index(joint.frame)])
        hold = np.full(6, np.inf)
        hold[direction] = joint.drive.position_gain
        rotor = n_places + len(extra)
        extra.append(spring.place[None])
        servo = Spring((spring.nodes[0], rotor), spring.axes, hold, spring.place)
        drives.append(Drive(servo, direction, joint.drive.reflected_inertia))
        behind.append(replace(spring, nodes=(rotor, spring.nodes[1])))
    return tuple(behind), tuple(drives)
