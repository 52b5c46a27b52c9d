"""The numbers of a robot that an update frees together, each with the belief about it before anything is measured."""

from dataclasses import dataclass

import numpy as np

from ...kinematics import drive_direction
from ...model_updating import end_bodies
from ...spatial import SpatialRobot, tool_spring

GROUPS = {"radial": (0, 1), "axial": (2,), "tilting": (3, 4), "turning": (5,)}
"""Directions of a joint that share one stiffness, in ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)``."""

FOUNDATION = "foundation"
"""Name of the fixed frame at which the base's springs stand."""

STIFFNESS_SPREAD = float(np.log(2))
"""Standard deviation of the logarithm of a stiffness: two thirds lie within a factor of two."""


@dataclass(frozen=True)
class UpdateParameter:
    """One number that an update frees, told as its difference ``x`` from the robot's file; ``x ~ N(0, spread^2)``.

    Parameters
    ----------
    name
        Name for people, and in the file: ``joint 3 stiffness``, ``payload mass``, ``base tilting compliance``.
    kind
        ``stiffness``, ``joint damping``, ``damping``, ``links``, ``payload``, ``tool mass``, ``tool``,
        ``sprung mass``, ``base``, ``inertia`` or ``body``.
    unit
        Unit of x; "" where x is a logarithm or a damping ratio.
    spread
        Standard deviation of the belief, in ``unit``.
    frame, group
        Joint of a stiffness or of a damping, and the group of its directions; empty for the others.
    axis
        Number of the direction of a payload's place (0 to 2) and 3 for its mass; of a tool or base, 0 or 1.
    """

    name: str
    kind: str
    unit: str
    spread: float
    frame: str = ""
    group: str = ""
    axis: int = 0

    @property
    def logarithmic(self) -> bool:
        """Whether x is the logarithm of a factor on the file's number."""
        return self.kind in ("stiffness", "links", "damping", "inertia")


def free_parameters(robot: SpatialRobot) -> tuple[UpdateParameter, ...]:
    """Every number of a robot in space that an update frees.

    Joint stiffnesses, the links and the robot's damping have a log-normal belief; a payload, compliances and the
    joints' own damping may have either sign. A compliance below zero is a stiffness that the file has too little of.

    Parameters
    ----------
    robot
        The robot as its file has it.
    """
    found = [*_stiffnesses(robot), *_joint_dampings(robot)]
    found.append(UpdateParameter("damping", "damping", "", 1.0))
    if any(link.section is not None for link in robot.links):
        found.append(UpdateParameter("links", "links", "", 0.5))
    found.append(UpdateParameter("payload mass", "payload", "kg", 15.0, axis=3))
    found += [UpdateParameter(f"payload place {axis}", "payload", "m", 0.2, axis=i) for i, axis in enumerate("xyz")]
    heaviest = heaviest_end(robot)
    if heaviest is not None and robot.bodies[heaviest].inertia.any():
        found.append(UpdateParameter("spindle inertia", "inertia", "", 0.3, axis=heaviest))
    found.append(UpdateParameter("tool mass", "tool mass", "kg", 2.0))
    found.append(UpdateParameter("tool lateral compliance", "tool", "m/N", 1.5e-7, axis=0))
    found.append(UpdateParameter("tool axial compliance", "tool", "m/N", 5e-8, axis=1))
    if tool_spring(robot) is None:
        found.append(UpdateParameter("mass on the tool's spring", "sprung mass", "kg", 0.2))
    if all(frame.name != FOUNDATION for frame in robot.mechanism.frames):
        found.append(UpdateParameter("base tilting compliance", "base", "rad/(N m)", 3e-8, axis=0))
        found.append(UpdateParameter("base radial compliance", "base", "m/N", 1e-8, axis=1))
    return tuple(found)


def heaviest_end(robot: SpatialRobot) -> int | None:
    """Index of the heaviest body after the last joint and before a tool's spring, the spindle; None: there is none."""
    sprung = tool_spring(robot) is not None
    ends = [
        i for i in end_bodies(robot) if robot.bodies[i].mass > 0 and not (sprung and robot.bodies[i].node == robot.tip)
    ]
    return max(ends, key=lambda i: robot.bodies[i].mass, default=None)


def unnamed_parameters(robot: SpatialRobot) -> tuple[UpdateParameter, ...]:
    """Masses of the bodies, a tenth uncertain: nothing is named that these could stand for as well."""
    return tuple(
        UpdateParameter(f"body {i + 1} mass", "body", "", 0.1, axis=i)
        for i, body in enumerate(robot.bodies)
        if body.mass > 0
    )


def _stiffnesses(robot: SpatialRobot) -> list[UpdateParameter]:
    """A factor for every group of finite stiffnesses; the tool's own spring is softened by its compliance instead."""
    found = []
    for joint in robot.joints:
        if joint is tool_spring(robot):
            continue
        frame = robot.mechanism.frames[robot.mechanism.index(joint.frame)]
        for group, places in GROUPS.items():
            if np.isfinite(joint.stiffness[places[0]]):
                own = drive_direction(frame) in places and frame.motion != "fixed"
                label = "stiffness" if own else f"{group} stiffness"
                name = f"joint {joint.frame} {label}"
                found.append(UpdateParameter(name, "stiffness", "", STIFFNESS_SPREAD, joint.frame, group))
    return found


def _joint_dampings(robot: SpatialRobot) -> list[UpdateParameter]:
    """Damping of each joint's own motion, as a ratio that it adds at :func:`reference_frequency`."""
    found = []
    for joint in robot.joints:
        frame = robot.mechanism.frames[robot.mechanism.index(joint.frame)]
        if frame.motion != "fixed" and np.isfinite(joint.stiffness[drive_direction(frame)]):
            found.append(UpdateParameter(f"joint {joint.frame} damping", "joint damping", "", 0.03, joint.frame))
    return found
