"""What may be wrong with a robot's model: every single change with one number that is weighed against data."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .gravity import with_gravity
from .spatial_robot import SpatialRobot
from .variations import with_damping_factor, with_joint_factor, with_link_factor, with_payload, with_rigid_links

Real = NDArray[np.float64]

Changed = tuple[SpatialRobot, Real]
"""A robot, and by how much its joints stand elsewhere than was said, rad, (n_moving,)."""


@dataclass(frozen=True)
class Change:
    """One thing that may be wrong, with one number.

    Parameters
    ----------
    name
        ``joint 3 stiffness``, ``links``, ``payload``, ``posture of joint 3``, ``gravity``, ``damping``.
    kind
        ``stiffness``, ``links``, ``payload``, ``posture``, ``gravity`` or ``damping``.
    unit
        Of the number; "" for a factor.
    logarithmic
        The number is positive and is fitted by its logarithm.
    values
        Numbers from which a search starts, from small to large change.
    bounds
        Within which the number is sought.
    neutral
        Number at which next to nothing is changed.
    apply
        From a robot and the number to the changed robot and the offset of its joints.
    """

    name: str
    kind: str
    unit: str
    logarithmic: bool
    values: tuple[float, ...]
    bounds: tuple[float, float]
    neutral: float
    apply: Callable[[SpatialRobot, float], Changed]

    def to_fit(self, number: float) -> float:
        """Coordinate in which it is fitted: ln, or the number itself."""
        return float(np.log(number)) if self.logarithmic else number

    def from_fit(self, coordinate: float) -> float:
        """Back to the number, kept within its bounds."""
        number = float(np.exp(min(coordinate, 700.0))) if self.logarithmic else coordinate
        return float(np.clip(number, *self.bounds))


_FACTORS = (0.05, 20.0)
_FACTOR_STARTS = tuple(float(value) for value in np.geomspace(0.2, 5.0, 16))
_LINK_STARTS = (*(float(value) for value in np.geomspace(0.05, 5.0, 12)), 100.0)
_PAYLOADS = tuple(float(value) for value in np.geomspace(0.5, 100.0, 14))
_OFFSETS = tuple(float(value) for value in np.radians([-8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0]))


def possible_changes(
    robot: SpatialRobot, *, payload_at: Real | None = None, rigid_links: bool = False
) -> tuple[Change, ...]:
    """Every change that this robot's model can undergo.

    A payload hangs at ``payload_at`` (3,) from the tool tip in the tool frame, m; None: at the tip. Gravity is weighed
    where the model has none and the chain is open; damping is one factor for all modes. ``rigid_links``: the model is
    used with its links made rigid, so that their flexibility may have been left out.
    """
    nothing = np.zeros(len(robot.mechanism.moving))
    changes = [
        Change(
            f"joint {joint.frame} stiffness",
            "stiffness",
            "",
            True,
            _FACTOR_STARTS,
            _FACTORS,
            1.0,
            partial(_with_joint, joint.frame, nothing),
        )
        for joint in robot.joints
        if np.isfinite(joint.stiffness).any()
    ]
    if any(link.section is not None for link in robot.links):
        name = "link flexibility left out" if rigid_links else "links"
        changes.append(Change(name, "links", "", True, _LINK_STARTS, (1e-2, 1e3), 1.0, partial(_with_links, nothing)))
    loaded = partial(_with_load, payload_at, nothing)
    changes.append(Change("payload", "payload", "kg", True, _PAYLOADS, (1e-3, 500.0), 0.05, loaded))
    for column, index in enumerate(robot.mechanism.moving):
        if robot.mechanism.frames[index].active and robot.mechanism.frames[index].motion == "revolute":
            name = f"posture of joint {robot.mechanism.frames[index].name}"
            offset = partial(_with_offset, np.eye(len(nothing))[column])
            changes.append(Change(name, "posture", "rad", False, _OFFSETS, (-0.5, 0.5), 0.0, offset))
    if not robot.gravity and not robot.mechanism.closures:
        gravity = Change("gravity", "gravity", "m/s^2", True, (9.81,), (1.0, 20.0), 1.0, partial(_with_weight, nothing))
        changes.append(gravity)
    if robot.damping_ratio or any(robot.rayleigh):
        damped = partial(_with_damping, nothing)
        changes.append(Change("damping", "damping", "", True, _FACTOR_STARTS, _FACTORS, 1.0, damped))
    return tuple(changes)


def changed_robot(
    robot: SpatialRobot, changes: Sequence[tuple[Change, float]], *, rigid_links: bool = False
) -> Changed:
    """The robot with all changes at their numbers.

    ``rigid_links``: the links are rigid unless one of the changes gives them their flexibility back.
    """
    offset = np.zeros(len(robot.mechanism.moving))
    for change, number in changes:
        robot, aside = change.apply(robot, number)
        offset = offset + aside
    if rigid_links and all(change.kind != "links" for change, _ in changes):
        robot = with_rigid_links(robot)
    return robot, offset


def _with_joint(frame: str, offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_joint_factor(robot, frame, factor), offset


def _with_links(offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_link_factor(robot, factor), offset


def _with_load(centre: Real | None, offset: Real, robot: SpatialRobot, mass: float) -> Changed:
    return with_payload(robot, mass, centre), offset


def _with_offset(direction: Real, robot: SpatialRobot, angle: float) -> Changed:
    return robot, angle * direction


def _with_weight(offset: Real, robot: SpatialRobot, gravity: float) -> Changed:
    return with_gravity(robot, gravity), offset


def _with_damping(offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_damping_factor(robot, factor), offset
