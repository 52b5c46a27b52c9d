"""The parameters that an update frees, and the structure with those parameters changed."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import Real

from ..finite_elements.beam_element import Section
from ..kinematics.mechanism import Frame, drive_direction
from ..model_updating.changes import end_bodies
from ..spatial.spatial_modes import TOOL_MASS, housing_node, tool_spring, with_tool_spring
from ..spatial.spatial_robot import ElasticJoint, Link, LumpedBody, SpatialRobot, structure_at

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


LEAST_COMPLIANCE = 1e-13
"""Compliance that counts as none: a spring of 1e13 N m/rad or N/m."""

REFERENCE = 2 * np.pi * 20.0
"""Angular frequency at which a joint's damping is told as a ratio, rad/s."""


def changed_by(robot: SpatialRobot, parameters: Sequence[UpdateParameter], x: Real) -> SpatialRobot:
    """Apply the differences x to a robot.

    A payload hangs on the spindle's node, and may have a negative mass: what the spindle has too much. Compliances that
    are zero or negative leave the robot rigid there. A tool that gives way takes its mass from the spindle.

    Parameters
    ----------
    robot
        The robot as its file has it.
    parameters
        What is changed.
    x : (n_parameters,)
        Differences in the parameters' units; logarithms for stiffnesses, links and damping.
    """
    values = np.asarray(x, dtype=float)
    found = with_stiffness_of(robot, parameters, values)
    ratio = float(np.exp(_of_kind(parameters, values, "damping").get(0, 0.0)))
    a, b = found.rayleigh
    damping = None if found.damping_ratio is None else ratio * found.damping_ratio
    found = replace(found, rayleigh=(ratio * a, ratio * b), damping_ratio=damping)
    found = _with_masses(found, parameters, values)
    mass = sprung_mass(_of_kind(parameters, values, "sprung mass").get(0, 0.0))
    found = _with_tool(found, _of_kind(parameters, values, "tool"), mass)
    base = _of_kind(parameters, values, "base")
    return with_foundation(found, base.get(0, 0.0), base.get(1, 0.0))


def with_stiffness_of(robot: SpatialRobot, parameters: Sequence[UpdateParameter], x: Real) -> SpatialRobot:
    """The robot with other joint stiffnesses, joint dampings and links."""
    joints = []
    for joint in robot.joints:
        stiffness, damping = joint.stiffness.copy(), joint.damping
        for one, value in zip(parameters, x, strict=True):
            if one.frame == joint.frame and joint is not tool_spring(robot):
                if one.kind == "stiffness":
                    stiffness[list(GROUPS[one.group])] *= np.exp(value)
                elif one.kind == "joint damping":
                    damping += value * damping_unit(robot, joint)
        joints.append(replace(joint, stiffness=stiffness, damping=float(damping)))
    factor = float(np.exp(_of_kind(parameters, x, "links").get(0, 0.0)))
    return replace(robot, joints=tuple(joints), links=tuple(_scaled(link, factor) for link in robot.links))


def damping_unit(robot: SpatialRobot, joint: ElasticJoint) -> float:
    """Viscous damping that adds a ratio of 1 at the reference: ``2 k / omega``, N m s/rad or N s/m."""
    frame = robot.mechanism.frames[robot.mechanism.index(joint.frame)]
    return float(2 * joint.stiffness[drive_direction(frame)] / REFERENCE)


def with_foundation(robot: SpatialRobot, tilting: float, radial: float) -> SpatialRobot:
    """The robot on a base that tilts (rad/(N m)) and shifts sideways (m/N); zero or less: it does not.

    A fixed frame ``foundation`` takes the place of frame 0, and a joint at it holds what node 0 held.
    """
    if tilting <= LEAST_COMPLIANCE and radial <= LEAST_COMPLIANCE:
        return robot
    k_tilt, k_side = (1 / c if c > LEAST_COMPLIANCE else np.inf for c in (tilting, radial))
    return on_springs(robot, np.array([k_side, k_side, np.inf, k_tilt, k_tilt, np.inf]))


def on_springs(robot: SpatialRobot, stiffness: Real) -> SpatialRobot:
    """The robot with a joint of that stiffness (6,) between the floor and its base."""
    mechanism, new = robot.mechanism, robot.n_nodes

    def moved(name: str) -> str:
        return FOUNDATION if name == "0" else name

    def node(number: int) -> int:
        return new if number == 0 else number

    def pair(nodes: tuple[int, int]) -> tuple[int, int]:
        return node(nodes[0]), node(nodes[1])

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
        bodies=tuple(replace(body, node=node(body.node), frame=moved(body.frame)) for body in robot.bodies),
        points=points,
    )


def carrier_node(robot: SpatialRobot) -> int:
    """Node on which a payload hangs: that of the heaviest body after the last joint, so that mass can be taken off it.

    The spindle's node where there is no such body.
    """
    heaviest = heaviest_end(robot)
    return housing_node(robot) if heaviest is None else robot.bodies[heaviest].node


def place_of_node(robot: SpatialRobot, node: int) -> Real:
    """Place of a node of the spindle from the tip, in the tool frame, m, (3,)."""
    reference = np.zeros(len(robot.mechanism.moving))
    positions = structure_at(replace(robot, gravity=0.0), reference).positions
    axes = robot.mechanism.transforms(reference)[robot.mechanism.index(robot.mechanism.tool), :3, :3]
    return np.asarray(axes.T @ (positions[node] - positions[robot.tip]))


def point_mass(robot: SpatialRobot, mass: float, place: Real, node: int | None = None) -> LumpedBody:
    """A point mass (kg, of either sign) at a place from the tip, tool frame, m; it hangs on :func:`carrier_node`."""
    at = carrier_node(robot) if node is None else node
    centre = np.asarray(place, dtype=float) - place_of_node(robot, at)
    return LumpedBody(at, robot.mechanism.tool, mass, centre, np.zeros((3, 3)))


def tool_node(robot: SpatialRobot) -> int:
    """Node that carries a further mass of the tool: the tip's behind a spring, else the spindle's."""
    return carrier_node(robot) if tool_spring(robot) is None else robot.tip


def _with_masses(robot: SpatialRobot, parameters: Sequence[UpdateParameter], x: Real) -> SpatialRobot:
    payload = _of_kind(parameters, x, "payload")
    turned = _of_kind(parameters, x, "inertia")
    bodies = tuple(
        replace(body, inertia=body.inertia * np.exp(turned[i])) if i in turned else body
        for i, body in enumerate(robot.bodies)
    )
    robot = replace(robot, bodies=bodies) if turned else robot
    added = []
    if payload.get(3, 0.0):
        place = np.array([payload.get(axis, 0.0) for axis in range(3)]) + payload_centre(robot)
        added.append(point_mass(robot, payload[3], place))
    at_tip = _of_kind(parameters, x, "tool mass").get(0, 0.0)
    if at_tip:
        added.append(point_mass(robot, at_tip, np.zeros(3), tool_node(robot)))
    return replace(robot, bodies=(*robot.bodies, *added))


def payload_centre(robot: SpatialRobot) -> Real:
    """Place about which a payload is believed to hang: 0.25 m behind the tip, where a spindle has its mass, m, (3,)."""
    return np.array([0.0, 0.0, -0.25])


def sprung_mass(further: float) -> float:
    """Mass that moves on the spring of a tool that gives way, kg: a small tool's, and what further moves with it."""
    return max(TOOL_MASS + further, 0.1 * TOOL_MASS)


def _with_tool(robot: SpatialRobot, added: dict[int, float], mass: float) -> SpatialRobot:
    lateral, axial = (max(added.get(axis, 0.0), 0.0) for axis in range(2))
    spring = tool_spring(robot)
    if spring is not None:  # a compliance below zero makes the file's spring stiffer, down to a tenth of its own
        own = 1 / spring.stiffness[:3]
        given = np.array([added.get(0, 0.0), added.get(0, 0.0), added.get(1, 0.0)])
        stiffness = np.append(1 / np.maximum(own + given, np.maximum(0.1 * own, 1e-12)), spring.stiffness[3:])
        joints = tuple(replace(joint, stiffness=stiffness) if joint is spring else joint for joint in robot.joints)
        return replace(robot, joints=joints)
    if max(lateral, axial) <= LEAST_COMPLIANCE:
        return robot
    lighter = replace(robot, bodies=(*robot.bodies, point_mass(robot, -mass, np.zeros(3), robot.tip)))
    return with_tool_spring(lighter, lateral, axial, mass)


def _of_kind(parameters: Sequence[UpdateParameter], x: Real, kind: str) -> dict[int, float]:
    """Numbers of one kind, by their axis."""
    return {one.axis: float(value) for one, value in zip(parameters, x, strict=True) if one.kind == kind}


def _scaled(link: Link, factor: float) -> Link:
    if link.section is None or factor == 1.0:
        return link
    stiff = ("axial", "bending_y", "bending_z", "torsion", "shear_y", "shear_z")
    section: Section = replace(link.section, **{name: factor * getattr(link.section, name) for name in stiff})
    return replace(link, section=section)
