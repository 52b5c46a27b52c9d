"""Changes of a robot's model, each with one number that is weighed against data."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from ..finite_elements import with_gravity
from ..spatial import SpatialRobot, tool_spring, with_tool_spring
from .change import Change, Changed, Companion, Numbered
from .variations import (
    end_bodies,
    with_damping_factor,
    with_joint_factor,
    with_lighter_end,
    with_link_factor,
    with_payload,
    with_rigid_links,
)

Real = NDArray[np.float64]

_FACTORS = (0.05, 20.0)
_MASSES = (0.2, 5.0)
_FACTOR_STARTS = tuple(float(value) for value in np.geomspace(0.2, 5.0, 16))
_LINK_STARTS = (*(float(value) for value in np.geomspace(0.05, 5.0, 12)), 100.0)
_PAYLOADS = tuple(float(value) for value in np.geomspace(0.5, 100.0, 14))
_COMPLIANCES = tuple(float(value) for value in np.geomspace(1e-8, 2e-6, 12))
_OFFSETS = tuple(float(value) for value in np.radians([-8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 4.0, 8.0]))


def possible_changes(
    robot: SpatialRobot, *, payload_at: Real | None = None, rigid_links: bool = False
) -> tuple[Change, ...]:
    """Every change that this robot's model can undergo.

    A payload hangs at ``payload_at`` (3,) from the tool tip in the tool frame, m; None: its place is not known and
    fitted with its mass. A negative one is mass that the model's spindle has and the robot's has not. A tool may give
    way where the model's is rigid. Gravity is weighed where the model has none and the chain is open; damping is one
    factor for all modes. ``rigid_links``: the model is used with its links made rigid, so that their flexibility may
    have been left out.
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
    changes.append(_payload(robot, payload_at))
    if tool_spring(robot) is None:
        changes.append(_tool(nothing))
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


def unnamed_changes(robot: SpatialRobot) -> tuple[Change, ...]:
    """Factors on the masses of bodies, which no diagnosis names: what numbers that are named owe to such errors."""
    nothing = np.zeros(len(robot.mechanism.moving))
    return tuple(
        Change(
            f"mass of the body on node {body.node}",
            "mass",
            "",
            True,
            _FACTOR_STARTS,
            _MASSES,
            1.0,
            partial(_with_mass, place, nothing),
        )
        for place, body in enumerate(robot.bodies)
        if body.mass > 0
    )


def _payload(robot: SpatialRobot, payload_at: Real | None) -> Change:
    """Mass at the tool end, of both signs, with its place where that is not known."""
    nothing = np.zeros(len(robot.mechanism.moving))
    lightest = -0.9 * max((robot.bodies[i].mass for i in end_bodies(robot)), default=0.0)
    values = _PAYLOADS + tuple(share * lightest for share in (0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9) if lightest)
    loaded = partial(_with_load, payload_at, nothing)
    places = () if payload_at is not None else _places(robot)
    return Change("payload", "payload", "kg", False, values, (lightest, 500.0), 0.0, loaded, 1.0, places)


def _places(robot: SpatialRobot) -> tuple[Companion, ...]:
    """Give the places where a mass may hang: between the last axis and the tip, a quarter of that beside the tool."""
    mechanism = robot.mechanism
    placed = mechanism.transforms(np.zeros(len(mechanism.moving)))
    tool, last = placed[mechanism.index(mechanism.tool)], placed[mechanism.moving[-1]]
    back = tool[:3, :3].T @ (last[:3, 3] - tool[:3, 3])
    reach = max(float(np.sqrt(back @ back)), 0.1)
    return tuple(
        Companion(f"place {axis} from the tip", "m", (middle - 1.0, middle + 1.0), middle, spread)
        for axis, middle, spread in zip("xyz", (back / 2).tolist(), (reach / 4, reach / 4, reach / 2), strict=True)
    )


def _tool(nothing: Real) -> Change:
    axial = Companion("axial", "m/N", (0.0, 1e-4), 0.0, 2e-7, 1e-8)
    given = partial(_with_tool, nothing)
    return Change("tool compliance", "tool", "m/N", True, _COMPLIANCES, (1e-10, 1e-4), 1e-9, given, 0.0, (axial,))


def changed_robot(robot: SpatialRobot, changes: Sequence[Numbered], *, rigid_links: bool = False) -> Changed:
    """The robot with all changes at their numbers, each with the numbers of its companions that follow it.

    ``rigid_links``: the links are rigid unless one of the changes gives them their flexibility back.
    """
    offset = np.zeros(len(robot.mechanism.moving))
    for position, (change, number) in enumerate(changes):
        if isinstance(change, Companion):
            continue
        own = [beside for one, beside in changes[position + 1 :] if one in change.companions]
        robot, aside = change.apply(robot, number, *own)
        offset = offset + aside
    if rigid_links and all(isinstance(change, Companion) or change.kind != "links" for change, _ in changes):
        robot = with_rigid_links(robot)
    return robot, offset


def _with_joint(frame: str, offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_joint_factor(robot, frame, factor), offset


def _with_links(offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_link_factor(robot, factor), offset


def _with_load(known: Real | None, offset: Real, robot: SpatialRobot, mass: float, *place: float) -> Changed:
    if mass == 0:
        return robot, offset
    if known is None and not place:
        place = tuple(one.neutral for one in _places(robot))
    where = np.array(place) if known is None else known
    if mass > 0:
        return with_payload(robot, mass, where), offset
    return with_lighter_end(robot, -mass, None if known is not None else where), offset


def _with_tool(offset: Real, robot: SpatialRobot, lateral: float, axial: float = 0.0) -> Changed:
    return with_tool_spring(robot, lateral, axial), offset


def _with_offset(direction: Real, robot: SpatialRobot, angle: float) -> Changed:
    return robot, angle * direction


def _with_weight(offset: Real, robot: SpatialRobot, gravity: float) -> Changed:
    return with_gravity(robot, gravity), offset


def _with_damping(offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    return with_damping_factor(robot, factor), offset


def _with_mass(place: int, offset: Real, robot: SpatialRobot, factor: float) -> Changed:
    bodies = list(robot.bodies)
    bodies[place] = replace(bodies[place], mass=factor * bodies[place].mass, inertia=factor * bodies[place].inertia)
    return replace(robot, bodies=tuple(bodies)), offset
