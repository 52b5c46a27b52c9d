"""`SpatialRobot`: a mechanism with compliance and mass of its joints, drives, links and bodies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from millfrf.core import InputError, Real

from ..finite_elements.beam_element import Section
from ..finite_elements.statics import gravity_stiffness
from ..finite_elements.structure import Beam, Body, Drive, Spring, Structure, cross_matrix
from ..kinematics.mechanism import Mechanism, drive_direction
from ..settings import ROBOT


@dataclass(frozen=True)
class JointDrive:
    """Motor behind the gear of a driven joint, held by the controller; all numbers are positive and finite."""

    motor_inertia: float  # J of rotor, brake, coupling and the fast side of the gear, kg m^2
    gear_ratio: float  # N: turns of the motor over those of the joint; rad/m for a prismatic joint
    position_gain: float  # static stiffness K_pos of the controller on the joint's side, N m/rad or N/m

    def __post_init__(self) -> None:
        for name in ("motor_inertia", "gear_ratio", "position_gain"):
            if not 0 < getattr(self, name) < float("inf"):
                raise InputError(f"drive: {name} = {getattr(self, name)!r} must be positive and finite")

    @property
    def reflected_inertia(self) -> float:
        """``N^2 J`` on the joint's side, kg m^2 or kg."""
        return self.gear_ratio**2 * self.motor_inertia


@dataclass(frozen=True)
class ElasticJoint:
    """Joint at the origin of a frame, between two nodes.

    A ``drive`` puts the motor's inertia before the stiffness, held by the controller; without a drive the motor stands
    still. ``damping`` is added to the damping of the robot and may have either sign.
    """

    frame: str
    nodes: tuple[int, int]
    stiffness: Real  # (6,): (K_r, K_r, K_a, K_rr, K_rr, K_ar), N/m and N m/rad; infinite: rigid (Belchior, Eq. 6)
    drive: JointDrive | None = None
    damping: float = 0.0  # viscous damping of the joint's own motion, N m s/rad or N s/m


@dataclass(frozen=True)
class Link:
    """A link from one node to another; a section makes it flexible, in ``elements`` beam elements.

    ``angles`` turn ``frame`` into the axes of the link, with x along its neutral axis. Without a frame, z is any
    normal, which is right for round sections.
    """

    nodes: tuple[int, int]
    section: Section | None = None
    elements: int = 1
    frame: str | None = None
    angles: tuple[float, float, float] = (0.0, 0.0, 0.0)  # delta, eta, kappa, rad (Belchior et al. 2013, Eq. 2)


@dataclass(frozen=True)
class LumpedBody:
    """Rigid body on a node; centre and inertia are in the axes of a frame."""

    node: int
    frame: str
    mass: float  # kg
    centre: Real  # (3,), m, from the node
    inertia: Real  # (3, 3), kg m^2, about the centre


@dataclass(frozen=True)
class SpatialRobot:
    """A robot in space as data; node 0 is clamped.

    Parameters
    ----------
    mechanism
        Kinematics of the robot: frames, joints and closed loops.
    joints, links, bodies
        Elastic joints, rigid or flexible links, and lumped bodies with mass.
    points
        Nodes that are at no joint, each with its frame and its place in that frame (m).
    tip
        Number of the node of the tool tip.
    rayleigh
        Constants ``(a, b)`` of ``C = a M + b K``, 1/s and s.
    damping_ratio
        Damping ratio of all modes, instead of Rayleigh's constants; or None.
    gravity : m/s^2
        Gravity against ``up``: the stiffness of weight is added to that of the joints; 0: it is neglected.
    up
        Unit vector against the weight, in the base frame: ``(0, 0, -1)`` for a robot that hangs from a ceiling.

    Raises
    ------
    InputError
        A frame that does not exist, a node without place or on two bodies, a link across a joint, a mass in the axes
        of another body, or gravity on a robot with closed loops.
    """

    mechanism: Mechanism
    joints: tuple[ElasticJoint, ...]
    links: tuple[Link, ...]
    bodies: tuple[LumpedBody, ...]
    points: dict[int, tuple[str, Real]]
    tip: int
    rayleigh: tuple[float, float] = (0.0, 0.0)
    damping_ratio: float | None = None
    gravity: float = 0.0
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        _check_frames(self)
        _check_nodes(self)
        _check_bodies(self)
        if self.gravity and self.mechanism.closures:
            raise InputError("gravity is given for open chains only; this robot has closed loops: leave it at 0")

    @property
    def n_nodes(self) -> int:
        """Number of nodes before beams are divided into elements."""
        return 1 + max({node for joint in self.joints for node in joint.nodes} | set(self.points))

    @property
    def has_joint_damping(self) -> bool:
        """Check whether any joint has viscous damping."""
        return any(joint.damping for joint in self.joints)

    def with_stiffness(self, stiffness: Real) -> SpatialRobot:
        """Return the robot with the given joint stiffnesses, shape (n_joints, 6), N/m and N m/rad."""
        joints = tuple(replace(j, stiffness=row) for j, row in zip(self.joints, stiffness, strict=True))
        return replace(self, joints=joints)


def _check_frames(robot: SpatialRobot) -> None:
    known = {"0"} | {frame.name for frame in robot.mechanism.frames}
    named = [(f"point at node {node}", name) for node, (name, _) in robot.points.items()]
    named += [(f"joint with nodes {list(joint.nodes)}", joint.frame) for joint in robot.joints]
    named += [(f"body at node {body.node}", body.frame) for body in robot.bodies]
    named += [(f"link {list(link.nodes)}", link.frame) for link in robot.links if link.frame is not None]
    for part, name in named:
        if name not in known:
            raise InputError(f"{part}: there is no frame {name!r}; the frames are {', '.join(sorted(known))}")
    if any(joint.frame == "0" for joint in robot.joints):
        raise InputError("a joint is at frame '0', the base, which does not move; give the frame after the joint")


def _check_nodes(robot: SpatialRobot) -> None:
    for kind, parts in (("joint", robot.joints), ("link", robot.links)):
        for part in parts:
            if part.nodes[0] == part.nodes[1]:
                raise InputError(f"{kind} {list(part.nodes)} starts and ends at one node; give two different nodes")
    placed = {node for joint in robot.joints for node in joint.nodes} | set(robot.points)
    used = {node for link in robot.links for node in link.nodes} | {body.node for body in robot.bodies} | {robot.tip}
    negative = sorted(node for node in used | placed if node < 0)
    if negative:
        raise InputError(f"robot: node {negative[0]} is negative; number nodes from 0, the clamped base")
    missing = sorted((used | set(range(max(used | placed) + 1))) - placed)
    if missing:
        raise InputError(f"robot: nodes {missing} are at no joint and no point; give their place")


def _check_bodies(robot: SpatialRobot) -> None:
    """Check that no link and no lumped mass belongs to two bodies, because it would bypass the joint between them."""
    owner = node_bodies(robot)
    if owner.get(0, "0") != "0":
        raise InputError(f"robot: node 0 is the clamped base, but it stands on frame {owner[0]}; renumber that node")
    for link in robot.links:
        first, second = (owner[node] for node in link.nodes)
        if first != second:
            raise InputError(
                f"link {list(link.nodes)} joins frames {first} and {second} and so bypasses the joint between them; "
                "let each link end on the body it starts on"
            )
    for body in robot.bodies:
        if robot.mechanism.body_of[body.frame] != owner[body.node]:
            raise InputError(
                f"body at node {body.node}: its frame {body.frame} is on another body than the node, which moves with "
                f"frame {owner[body.node]}; give it that frame"
            )


def node_bodies(robot: SpatialRobot) -> dict[int, str]:
    """Return the body of each node, named as in :attr:`Mechanism.body_of`; a node on two bodies is an error.

    The first node of a joint is on the body before the joint, the second on the body after it. A point is on the body
    of its frame.
    """
    mechanism = robot.mechanism
    before = {frame.name: frame.antecedent for frame in mechanism.frames}
    claims = [(node, mechanism.body_of[name], f"point in frame {name}") for node, (name, _) in robot.points.items()]
    for joint in robot.joints:
        claims.append((joint.nodes[0], mechanism.body_of[before[joint.frame]], f"joint {joint.frame}"))
        claims.append((joint.nodes[1], mechanism.body_of[joint.frame], f"joint {joint.frame}"))
    owner: dict[int, tuple[str, str]] = {}
    for node, body, part in claims:
        known, first = owner.setdefault(node, (body, part))
        if known != body:
            raise InputError(
                f"robot: node {node} stands on two bodies: {part} puts it on that of frame {body}, {first} on that of "
                f"frame {known}; a joint's first node is on the body before it, its second on the body after it"
            )
    return {node: body for node, (body, _) in owner.items()}


def structure_at(robot: SpatialRobot, q: Real) -> Structure:
    """Build the elastic structure at the joint values q (n_moving,), in the base frame.

    Raises
    ------
    InputError
        A link frame whose x axis does not lie along its link.
    """
    mechanism = robot.mechanism
    placed = mechanism.transforms(q)
    frames = {frame.name: placed[i] for i, frame in enumerate(mechanism.frames)} | {"0": np.eye(4)}
    places = _node_places(robot, frames)
    springs = tuple(
        Spring(joint.nodes, frames[joint.frame][:3, :3], joint.stiffness, frames[joint.frame][:3, 3])
        for joint in robot.joints
    )
    beams: list[Beam] = []
    extra: list[Real] = []  # places (1, 3) of nodes inside links and of rotors, numbered after the robot's own nodes
    for link in robot.links:
        if link.section is not None:
            _divide(link, link.section, frames, places, beams, extra)
    springs, drives = _with_rotors(robot, springs, extra, len(places))
    positions = np.vstack([places, *extra]) if extra else places
    rigid = tuple(link.nodes for link in robot.links if link.section is None)
    bodies = tuple(_body(body, frames[body.frame][:3, :3]) for body in robot.bodies)
    structure = Structure(positions, springs, tuple(beams), rigid, bodies, robot.tip, drives=drives)
    if not robot.gravity:
        return structure
    return replace(structure, weight=gravity_stiffness(robot, q, structure))


def _node_places(robot: SpatialRobot, frames: dict[str, Real]) -> Real:
    """Compute the place of each node, m, (n_nodes, 3), base frame: its point, or the first joint that names it."""
    places = np.zeros((robot.n_nodes, 3))
    for joint in reversed(robot.joints):
        places[list(joint.nodes)] = frames[joint.frame][:3, 3]
    for node, (name, place) in robot.points.items():
        places[node] = frames[name][:3, :3] @ place + frames[name][:3, 3]
    return places


def _with_rotors(
    robot: SpatialRobot, springs: tuple[Spring, ...], extra: list[Real], n_places: int
) -> tuple[tuple[Spring, ...], tuple[Drive, ...]]:
    """Return the joints' springs, which begin at the rotor if there is a drive, and all drives.

    The places of the rotors are appended to ``extra``.
    """
    from_rotor, drives = [], []
    for joint, spring in zip(robot.joints, springs, strict=True):
        if joint.drive is None:
            from_rotor.append(spring)
            continue
        direction = drive_direction(robot.mechanism.frames[robot.mechanism.index(joint.frame)])
        servo_stiffness = np.full(6, np.inf)
        servo_stiffness[direction] = joint.drive.position_gain
        rotor = n_places + len(extra)
        extra.append(spring.place[None])
        servo = Spring((spring.nodes[0], rotor), spring.axes, servo_stiffness, spring.place)
        drives.append(Drive(servo, direction, joint.drive.reflected_inertia))
        from_rotor.append(replace(spring, nodes=(rotor, spring.nodes[1])))
    return tuple(from_rotor), tuple(drives)


def _divide(
    link: Link, section: Section, frames: dict[str, Real], places: Real, beams: list[Beam], extra: list[Real]
) -> None:
    """Add the beam elements of a link to ``beams``, and their inner nodes to ``extra``."""
    start, end = places[link.nodes[0]], places[link.nodes[1]]
    axes = _link_axes(link, frames, end - start)
    inner = [len(places) + len(extra) + i for i in range(link.elements - 1)]
    extra += [(start + (end - start) * (i + 1) / link.elements)[None] for i in range(link.elements - 1)]
    beams += [Beam(pair, axes, section) for pair in pairwise([link.nodes[0], *inner, link.nodes[1]])]


def _link_axes(link: Link, frames: dict[str, Real], along: Real) -> Real:
    length = float(np.sqrt(along @ along))
    if length < 1e-9:
        raise InputError(f"link {link.nodes}: its nodes are at one place; leave the link out or make it rigid")
    x = along / length
    if link.frame is None:
        y = cross_matrix(np.eye(3)[np.argmin(np.abs(x))]) @ x
        y /= np.sqrt(y @ y)
        return np.array([x, y, cross_matrix(x) @ y]).T
    axes = frames[link.frame][:3, :3] @ link_rotation(*link.angles)
    if axes[:, 0] @ x < 1 - 1e-6:
        raise InputError(f"link {link.nodes}: x of its frame lies {axes[:, 0].round(3)}, the link {x.round(3)}")
    return np.asarray(axes)


def link_rotation(delta: float, eta: float, kappa: float) -> Real:
    """``Rot(x, delta) Rot(y, eta) Rot(z, kappa)``, (3, 3) (Belchior et al. 2013, Eq. 2)."""
    (cx, sx), (cy, sy), (cz, sz) = ((np.cos(angle), np.sin(angle)) for angle in (delta, eta, kappa))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_x @ about_y @ about_z)


def _body(body: LumpedBody, axes: Real) -> Body:
    return Body(body.node, body.mass, axes @ body.centre, axes @ body.inertia @ axes.T)


def drive_stiffness(robot: SpatialRobot) -> Real:
    """Compute the stiffness of each driven joint in the direction of its motion, (n_active,), N m/rad or N/m.

    Values follow the order of the driven frames. A frame without a joint is infinitely stiff. The position gain of a
    drive acts in series with the joint's stiffness: ``1 / (1 / k + 1 / K_pos)``.
    """
    values = []
    for frame in robot.mechanism.joints:
        if frame.active:
            joints = [joint for joint in robot.joints if joint.frame == frame.name]
            parallel = sum(_in_series(joint, drive_direction(frame)) for joint in joints)
            values.append(float(parallel) if joints else np.inf)
    return np.array(values)


def _in_series(joint: ElasticJoint, direction: int) -> float:
    stiffness = float(joint.stiffness[direction])
    return stiffness if joint.drive is None else 1 / (1 / stiffness + 1 / joint.drive.position_gain)


def rigid_arm_warnings(robot: SpatialRobot, structure: Structure) -> tuple[str, ...]:
    """Return one warning for each pair of joints that share a node but stand apart: the part between them is rigid."""
    warnings = []
    for node in range(robot.n_nodes):
        at_node = [
            (joint.frame, spring.place)
            for joint, spring in zip(robot.joints, structure.springs, strict=True)
            if node in joint.nodes
        ]
        for (first, place), (second, other) in pairwise(at_node):
            distance = float(np.linalg.norm(place - other))
            if distance > ROBOT.same_place:
                warnings.append(
                    f"joints {first} and {second} share node {node} and stand {distance:.3g} m apart: the body between "
                    "them is taken as rigid; give each its own node and a [[links]] tube between them if it is not"
                )
    return tuple(warnings)


def check_tip(robot: SpatialRobot) -> None:
    """Check that the tip node is at the origin of the tool frame: postures use the frame, forces use the node."""
    mechanism = robot.mechanism
    q = np.zeros(len(mechanism.moving))
    without_links = replace(robot, links=(), gravity=0.0)
    offset = structure_at(without_links, q).positions[robot.tip] - mechanism.tool_transform(q)[:3, 3]
    distance = float(np.linalg.norm(offset))
    if distance > ROBOT.same_place or node_bodies(robot)[robot.tip] != mechanism.body_of[mechanism.tool]:
        raise InputError(
            f"tip_node {robot.tip} stands {distance:.3g} m from the origin of the tool frame {mechanism.tool!r}, or on "
            "another body; place that node in the tool frame at [0, 0, 0]"
        )
