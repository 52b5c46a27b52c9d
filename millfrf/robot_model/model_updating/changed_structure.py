"""The parameters that an update frees, and the robot with those parameters changed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Real

from ..identification.elastic_parameters import GROUPS
from ..kinematics.mechanism import Frame, drive_direction
from ..settings import UPDATE
from ..spatial.spatial_modes import TOOL_MASS, housing_node, tool_spring, with_tool_spring
from ..spatial.spatial_robot import ElasticJoint, LumpedBody, SpatialRobot, structure_at
from .changes import end_bodies, with_damping_factor, with_link_factor

FOUNDATION = "foundation"  # fixed frame at which the base's springs stand
PAYLOAD_CENTRE = np.array([0.0, 0.0, -0.25])  # prior mean of a payload's place from the tip, m: a spindle's centre


@dataclass(frozen=True)
class UpdateParameter:
    """One number that an update may change; ``x ~ N(0, spread^2)`` is its difference from the robot's file.

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
        Prior standard deviation, in ``unit``.
    frame, group
        Joint of a stiffness or of a damping, and group of directions of that joint; empty for other kinds.
    axis
        For a payload, the direction of its place (0 to 2), or 3 for its mass. For a tool or base, the number of the
        compliance, 0 or 1. For an inertia or a body, the index of the body.
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
        """Check whether x is the logarithm of a factor on the file's number."""
        return self.kind in ("stiffness", "links", "damping", "inertia")


def free_parameters(robot: SpatialRobot) -> tuple[UpdateParameter, ...]:
    """List every number of a spatial robot that an update frees, with its prior.

    Joint stiffnesses, the links and the robot's damping have a log-normal prior. A payload, compliances and the damping
    of joints may have either sign: a negative compliance means that a stiffness in the file is too low.
    """
    parameters = [*_stiffnesses(robot), *_joint_dampings(robot), UpdateParameter("damping", "damping", "", 1.0)]
    if any(link.section is not None for link in robot.links):
        parameters.append(UpdateParameter("links", "links", "", 0.5))
    parameters.append(UpdateParameter("payload mass", "payload", "kg", 15.0, axis=3))
    parameters += [
        UpdateParameter(f"payload place {axis}", "payload", "m", 0.2, axis=i) for i, axis in enumerate("xyz")
    ]
    heaviest = _heaviest_end(robot)
    if heaviest is not None and robot.bodies[heaviest].inertia.any():
        parameters.append(UpdateParameter("spindle inertia", "inertia", "", 0.3, axis=heaviest))
    parameters.append(UpdateParameter("tool mass", "tool mass", "kg", 2.0))
    parameters.append(UpdateParameter("tool lateral compliance", "tool", "m/N", 1.5e-7, axis=0))
    parameters.append(UpdateParameter("tool axial compliance", "tool", "m/N", 5e-8, axis=1))
    if tool_spring(robot) is None:
        parameters.append(UpdateParameter("mass on the tool's spring", "sprung mass", "kg", 0.2))
    if all(frame.name != FOUNDATION for frame in robot.mechanism.frames):
        parameters.append(UpdateParameter("base tilting compliance", "base", "rad/(N m)", 3e-8, axis=0))
        parameters.append(UpdateParameter("base radial compliance", "base", "m/N", 1e-8, axis=1))
    return tuple(parameters)


def _heaviest_end(robot: SpatialRobot) -> int | None:
    """Find the spindle, the heaviest body after the last joint and before a tool's spring; return its index or None."""
    sprung = tool_spring(robot) is not None
    ends = [
        i for i in end_bodies(robot) if robot.bodies[i].mass > 0 and not (sprung and robot.bodies[i].node == robot.tip)
    ]
    return max(ends, key=lambda i: robot.bodies[i].mass, default=None)


def body_masses(robot: SpatialRobot) -> tuple[UpdateParameter, ...]:
    """List the bodies' masses as parameters with a spread of 10 %.

    They are freed only to test whether wrong masses could explain the change of another number.
    """
    return tuple(
        UpdateParameter(f"body {i + 1} mass", "body", "", 0.1, axis=i)
        for i, body in enumerate(robot.bodies)
        if body.mass > 0
    )


def _stiffnesses(robot: SpatialRobot) -> list[UpdateParameter]:
    """List one factor for every group of finite joint stiffnesses, without the tool's spring (see kind ``tool``)."""
    parameters = []
    for joint in robot.joints:
        if joint is tool_spring(robot):
            continue
        frame = robot.mechanism.frames[robot.mechanism.index(joint.frame)]
        for group, places in GROUPS.items():
            if np.isfinite(joint.stiffness[places[0]]):
                own = drive_direction(frame) in places and frame.motion != "fixed"
                name = f"joint {joint.frame} {'stiffness' if own else f'{group} stiffness'}"
                spread = float(np.log(2))  # two thirds lie within a factor of two
                parameters.append(UpdateParameter(name, "stiffness", "", spread, joint.frame, group))
    return parameters


def _joint_dampings(robot: SpatialRobot) -> list[UpdateParameter]:
    """List the damping of each elastic joint along or about its axis, in units of :func:`damping_unit`."""
    parameters = []
    for joint in robot.joints:
        frame = robot.mechanism.frames[robot.mechanism.index(joint.frame)]
        if frame.motion != "fixed" and np.isfinite(joint.stiffness[drive_direction(frame)]):
            parameters.append(UpdateParameter(f"joint {joint.frame} damping", "joint damping", "", 0.03, joint.frame))
    return parameters


def of_kind(parameters: Sequence[UpdateParameter], x: Real, kind: str) -> dict[int, float]:
    """Return the differences x of all parameters of one kind, by :attr:`UpdateParameter.axis`."""
    return {p.axis: float(value) for p, value in zip(parameters, x, strict=True) if p.kind == kind}


def value_of(parameters: Sequence[UpdateParameter], x: Real, kind: str, axis: int = 0) -> float:
    """Return the difference x of one parameter; 0 if the parameter is not among ``parameters``."""
    return of_kind(parameters, x, kind).get(axis, 0.0)


def changed_by(robot: SpatialRobot, parameters: Sequence[UpdateParameter], x: Real) -> SpatialRobot:
    """Apply the differences x (n_parameters,) to a robot.

    A payload hangs on the spindle's node and may have a negative mass, where the spindle is lighter than in the file.
    Compliances that are zero or negative leave the robot rigid there. A compliant tool takes its mass from the spindle.
    """
    values = np.asarray(x, dtype=float)
    changed = _with_joints(robot, parameters, values)
    changed = with_link_factor(changed, float(np.exp(value_of(parameters, values, "links"))))
    changed = with_damping_factor(changed, float(np.exp(value_of(parameters, values, "damping"))))
    changed = _with_masses(changed, parameters, values)
    mass = sprung_mass(value_of(parameters, values, "sprung mass"))
    changed = _with_tool(changed, of_kind(parameters, values, "tool"), mass)
    tilting, radial = (value_of(parameters, values, "base", axis) for axis in (0, 1))
    if tilting <= UPDATE.least_compliance and radial <= UPDATE.least_compliance:
        return changed
    k_tilt, k_side = (1 / c if c > UPDATE.least_compliance else np.inf for c in (tilting, radial))
    return on_springs(changed, np.array([k_side, k_side, np.inf, k_tilt, k_tilt, np.inf]))


def _with_joints(robot: SpatialRobot, parameters: Sequence[UpdateParameter], x: Real) -> SpatialRobot:
    joints = []
    for joint in robot.joints:
        stiffness, damping = joint.stiffness.copy(), joint.damping
        for parameter, value in zip(parameters, x, strict=True):
            if parameter.frame == joint.frame and joint is not tool_spring(robot):
                if parameter.kind == "stiffness":
                    stiffness[list(GROUPS[parameter.group])] *= np.exp(value)
                elif parameter.kind == "joint damping":
                    damping += value * damping_unit(robot, joint)
        joints.append(replace(joint, stiffness=stiffness, damping=float(damping)))
    return replace(robot, joints=tuple(joints))


def damping_unit(robot: SpatialRobot, joint: ElasticJoint) -> float:
    """Compute the joint's viscous damping ``2 k / omega`` for a damping ratio of 1 at 20 Hz, N m s/rad or N s/m."""
    frame = robot.mechanism.frames[robot.mechanism.index(joint.frame)]
    return float(2 * joint.stiffness[drive_direction(frame)] / (2 * np.pi * 20.0))


def on_springs(robot: SpatialRobot, stiffness: Real) -> SpatialRobot:
    """Return the robot with an elastic joint of ``stiffness`` (6,) between the floor and its base.

    A fixed frame ``foundation`` and a new node carry everything that stood on frame 0 and node 0.
    """
    mechanism, new = robot.mechanism, robot.n_nodes

    def moved(name: str) -> str:
        return FOUNDATION if name == "0" else name

    def pair(nodes: tuple[int, int]) -> tuple[int, int]:
        return nodes[0] or new, nodes[1] or new

    frames = (
        Frame(FOUNDATION, "0", motion="fixed"),
        *(replace(frame, antecedent=moved(frame.antecedent)) for frame in mechanism.frames),
    )
    points = {number: (moved(name), place) for number, (name, place) in robot.points.items() if number}
    if 0 in robot.points:
        points |= {0: robot.points[0], new: (FOUNDATION, robot.points[0][1])}
    joints = tuple(replace(joint, nodes=pair(joint.nodes)) for joint in robot.joints)
    return replace(
        robot,
        mechanism=replace(mechanism, frames=frames),
        joints=(*joints, ElasticJoint(FOUNDATION, (0, new), stiffness)),
        links=tuple(
            replace(link, nodes=pair(link.nodes), frame=None if link.frame is None else moved(link.frame))
            for link in robot.links
        ),
        bodies=tuple(replace(body, node=body.node or new, frame=moved(body.frame)) for body in robot.bodies),
        points=points,
    )


def carrier_node(robot: SpatialRobot) -> int:
    """Return the node of the spindle's body, or of the spindle's housing if the robot has no such body.

    A payload hangs on this node; a negative payload makes the spindle lighter.
    """
    heaviest = _heaviest_end(robot)
    return housing_node(robot) if heaviest is None else robot.bodies[heaviest].node


def tool_node(robot: SpatialRobot) -> int:
    """Return the node that carries an additional tool mass: the tip if the tool has a spring, or the carrier node."""
    return carrier_node(robot) if tool_spring(robot) is None else robot.tip


def place_of_node(robot: SpatialRobot, node: int) -> Real:
    """Compute the place of a node of the spindle relative to the tip, in the tool frame, m, (3,)."""
    reference = np.zeros(len(robot.mechanism.moving))
    positions = structure_at(replace(robot, gravity=0.0), reference).positions
    axes = robot.mechanism.transforms(reference)[robot.mechanism.index(robot.mechanism.tool), :3, :3]
    return np.asarray(axes.T @ (positions[node] - positions[robot.tip]))


def point_mass(robot: SpatialRobot, mass: float, place: Real, node: int | None = None) -> LumpedBody:
    """Build a point mass (kg, of either sign) at ``place`` from the tip (tool frame, m) on a node.

    Without ``node`` it hangs on the carrier node.
    """
    at = carrier_node(robot) if node is None else node
    centre = np.asarray(place, dtype=float) - place_of_node(robot, at)
    return LumpedBody(at, robot.mechanism.tool, mass, centre, np.zeros((3, 3)))


def payload_place(payload: dict[int, float]) -> Real:
    """Compute the place of a payload relative to the tip (tool frame, m, (3,)) from its differences by axis."""
    return np.asarray([payload.get(axis, 0.0) for axis in range(3)] + PAYLOAD_CENTRE)


def _with_masses(robot: SpatialRobot, parameters: Sequence[UpdateParameter], x: Real) -> SpatialRobot:
    payload, inertia = of_kind(parameters, x, "payload"), of_kind(parameters, x, "inertia")
    bodies = tuple(
        replace(body, inertia=body.inertia * np.exp(inertia[i])) if i in inertia else body
        for i, body in enumerate(robot.bodies)
    )
    robot = replace(robot, bodies=bodies)
    added = []
    if payload.get(3, 0.0):
        added.append(point_mass(robot, payload[3], payload_place(payload)))
    at_tip = value_of(parameters, x, "tool mass")
    if at_tip:
        added.append(point_mass(robot, at_tip, np.zeros(3), tool_node(robot)))
    return replace(robot, bodies=(*robot.bodies, *added))


def sprung_mass(further: float) -> float:
    """Compute the mass on a tool's spring, kg: the default mass plus ``further``, at least a tenth of the default."""
    return max(TOOL_MASS + further, 0.1 * TOOL_MASS)


def _with_tool(robot: SpatialRobot, added: dict[int, float], mass: float) -> SpatialRobot:
    lateral, axial = added.get(0, 0.0), added.get(1, 0.0)
    spring = tool_spring(robot)
    if spring is not None:  # a negative compliance makes the file's spring stiffer, by ten times at most
        own = 1 / spring.stiffness[:3]
        softer = own + np.array([lateral, lateral, axial])
        stiffness = np.append(1 / np.maximum(softer, np.maximum(0.1 * own, 1e-12)), spring.stiffness[3:])
        joints = tuple(replace(joint, stiffness=stiffness) if joint is spring else joint for joint in robot.joints)
        return replace(robot, joints=joints)
    lateral, axial = max(lateral, 0.0), max(axial, 0.0)
    if max(lateral, axial) <= UPDATE.least_compliance:
        return robot
    lighter = replace(robot, bodies=(*robot.bodies, point_mass(robot, -mass, np.zeros(3), robot.tip)))
    return with_tool_spring(lighter, lateral, axial, mass)
