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


@dataclass(frozen=True)
class JointDrive:
    """Motor behind the gear of a driven joint, held by the controller.

    Parameters
    ----------
    motor_inertia : kg m^2
        Moment of inertia J of what turns with the motor: rotor, brake, coupling, the gear's fast side.
    gear_ratio
        N: turns of the motor over those of the joint; rad/m for a prismatic joint.
    position_gain : N m/rad or N/m
        Static stiffness K_pos with which the controller holds the motor, on the joint's side.

    Raises
    ------
    InputError
        A number that is not positive and finite.
    """

    motor_inertia: float
    gear_ratio: float
    position_gain: float

    def __post_init__(self) -> None:
        for name in ("motor_inertia", "gear_ratio", "position_gain"):
            if not 0 < getattr(self, name) < float("inf"):
                raise InputError(f"drive: {name} = {getattr(self, name)!r} must be positive and finite")

    @property
    def reflected_inertia(self) -> float:
        """``N^2 J`` on the joint's side, kg m^2 or kg.

        Examples
        --------
        >>> round(JointDrive(0.004, 200.0, 1e7).reflected_inertia, 6)
        160.0
        """
        return self.gear_ratio**2 * self.motor_inertia


def check_robot(robot: SpatialRobot) -> None:
    """Refuse a robot whose parts do not fit together.

    A node stands on one body: the body before a joint for the joint's first node, the body after it for the second,
    the frame's own for a point. Links and lumped masses stay on one body, or they would bypass a joint.

    Raises
    ------
    InputError
        A frame that is not there, a node that is placed nowhere or on two bodies, a link over a joint, a mass in the
        axes of another body, or gravity on a robot with closed loops.
    """
    _frames_exist(robot)
    _nodes_exist(robot)
    owner = node_bodies(robot)
    if owner.get(0, "0") != "0":
        raise InputError(f"robot: node 0 is the clamped base, but it stands on frame {owner[0]}; number that node anew")
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
    if robot.gravity and robot.mechanism.closures:
        raise InputError("gravity is given for open chains only; this robot has closed loops: leave it at 0")


def node_bodies(robot: SpatialRobot) -> dict[int, str]:
    """Body of each node, named as in :attr:`millfrf.robot_model.Mechanism.body_of`.

    Raises
    ------
    InputError
        A node that two joints, or a joint and a point, put on different bodies.
    """
    mechanism = robot.mechanism
    before = {frame.name: frame.antecedent for frame in mechanism.frames}
    claims = [(node, mechanism.body_of[name], f"point in frame {name}") for node, (name, _) in robot.points.items()]
    for joint in robot.joints:
        claims.append((joint.nodes[0], mechanism.body_of[before[joint.frame]], f"joint {joint.frame}"))
        claims.append((joint.nodes[1], mechanism.body_of[joint.frame], f"joint {joint.frame}"))
    owner: dict[int, tuple[str, str]] = {}
    for node, body, who in claims:
        known, first = owner.setdefault(node, (body, who))
        if known != body:
            raise InputError(
                f"robot: node {node} stands on two bodies: {who} puts it on that of frame {body}, {first} on that of "
                f"frame {known}; a joint's first node is on the body before it, its second on the body after it"
            )
    return {node: body for node, (body, _) in owner.items()}


def _frames_exist(robot: SpatialRobot) -> None:
    known = {"0"} | {frame.name for frame in robot.mechanism.frames}
    named = [(f"point at node {node}", name) for node, (name, _) in robot.points.items()]
    named += [(f"joint with nodes {list(joint.nodes)}", joint.frame) for joint in robot.joints]
    named += [(f"body at node {body.node}", body.frame) for body in robot.bodies]
    named += [(f"link {list(link.nodes)}", link.frame) for link in robot.links if link.frame is not None]
    for who, name in named:
        if name not in known:
            raise InputError(f"{who}: there is no frame {name!r}; the frames are {', '.join(sorted(known))}")
    if any(joint.frame == "0" for joint in robot.joints):
        raise InputError("a joint is at frame '0', the base, which does not move; give the frame after the joint")


def _nodes_exist(robot: SpatialRobot) -> None:
    for what, pairs in (("joint", robot.joints), ("link", robot.links)):
        for pair in pairs:
            if pair.nodes[0] == pair.nodes[1]:
                raise InputError(f"{what} {list(pair.nodes)} starts and ends at one node; give two different nodes")
    placed = {node for joint in robot.joints for node in joint.nodes} | set(robot.points)
    wanted = {node for link in robot.links for node in link.nodes} | {body.node for body in robot.bodies} | {robot.tip}
    negative = sorted(node for node in wanted | placed if node < 0)
    if negative:
        raise InputError(f"robot: node {negative[0]} is negative; number nodes from 0, the clamped base")
    missing = sorted((wanted | set(range(max(wanted | placed) + 1))) - placed)
    if missing:
        raise InputError(f"robot: nodes {missing} are at no joint and no point; give their place")


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


@dataclass(frozen=True)
class ElasticJoint:
    """Joint at the origin of a frame, between two nodes.

    ``stiffness`` (6,) is ``(K_r, K_r, K_a, K_rr, K_rr, K_ar)`` in N/m and N m/rad about the frame's axes, infinite
    where rigid (Belchior et al. 2013, Eq. 6). A ``drive`` puts its motor's inertia before this stiffness, held by the
    controller; without one the motor stands still. ``damping`` is the viscous damping of the joint's own motion (about
    z, or along z of a prismatic joint), N m s/rad or N s/m, beside the robot's own damping and of either sign.
    """

    frame: str
    nodes: tuple[int, int]
    stiffness: Real
    drive: JointDrive | None = None
    damping: float = 0.0


@dataclass(frozen=True)
class Link:
    """A link from one node to another; a section makes it flexible, in ``elements`` beam elements.

    ``frame`` and ``angles`` (delta, eta, kappa; rad) turn a frame into the link's, x along the neutral axis (Belchior
    et al. 2013, Eq. 2); without a frame, z is any normal (round sections).
    """

    nodes: tuple[int, int]
    section: Section | None = None
    elements: int = 1
    frame: str | None = None
    angles: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class LumpedBody:
    """Rigid body on a node: mass, kg; centre from the node, m, and inertia about it, kg m^2, in the axes of a frame."""

    node: int
    frame: str
    mass: float
    centre: Real
    inertia: Real


@dataclass(frozen=True)
class SpatialRobot:
    """A robot as data; node 0 is clamped.

    Parameters
    ----------
    mechanism
        Kinematics of the robot: frames, joints and closed loops.
    joints, links, bodies
        Elastic joints, flexible links, and lumped bodies with mass.
    points
        Nodes that are at no joint, each with its frame and its place in it (m).
    tip
        Number of the node of the tool tip.
    rayleigh
        Constants ``(a, b)`` of ``C = a M + b K``, 1/s and s.
    damping_ratio
        Damping ratio of all modes, instead of Rayleigh's constants; or None.
    gravity : m/s^2
        Gravity against ``up``: the stiffness of weight is added to that of the joints; 0: left out.
    up
        Unit vector against which weight acts, in the base frame: ``(0, 0, -1)`` for a robot that hangs from a ceiling.

    Raises
    ------
    InputError
        Parts that do not fit together: see ``check_robot``.
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
        check_robot(self)

    @property
    def n_nodes(self) -> int:
        """Nodes H, before beams are divided."""
        return 1 + max({node for joint in self.joints for node in joint.nodes} | set(self.points))

    def with_stiffness(self, stiffness: Real) -> SpatialRobot:
        """The robot with other joint stiffnesses, shape (n_joints, 6)."""
        joints = tuple(replace(j, stiffness=row) for j, row in zip(self.joints, stiffness, strict=True))
        return replace(self, joints=joints)


def structure_at(robot: SpatialRobot, q: Real) -> Structure:
    """The elastic structure at the joint values q (n_moving,), in the base frame.

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
    extra: list[Real] = []
    for link in robot.links:
        if link.section is not None:
            _divide(link, frames, places, beams, extra)
    springs, drives = with_rotors(robot, springs, extra, len(places))
    positions = np.vstack([places, *extra]) if extra else places
    rigid = tuple(link.nodes for link in robot.links if link.section is None)
    bodies = tuple(_body(body, frames[body.frame][:3, :3]) for body in robot.bodies)
    structure = Structure(positions, springs, tuple(beams), rigid, bodies, robot.tip, drives=drives)
    if not robot.gravity:
        return structure
    return replace(structure, weight=gravity_stiffness(robot, q, structure))


def drive_stiffness(robot: SpatialRobot) -> Real:
    """Stiffness of each driven joint along its own motion, (n_active,): N m/rad about z, N/m along z if prismatic.

    In the order of the driven frames, whatever the order of ``robot.joints``; infinite where a frame has no joint. A
    drive's position gain is in series: ``1 / (1 / k + 1 / K_pos)``.
    """
    found = []
    for index in robot.mechanism.moving:
        frame = robot.mechanism.frames[index]
        if frame.active:
            own = [_in_series(joint, drive_direction(frame)) for joint in robot.joints if joint.frame == frame.name]
            found.append(float(sum(own)) if own else np.inf)
    return np.array(found)


def _in_series(joint: ElasticJoint, direction: int) -> float:
    stiffness = float(joint.stiffness[direction])
    return stiffness if joint.drive is None else 1 / (1 / stiffness + 1 / joint.drive.position_gain)


def _node_places(robot: SpatialRobot, frames: dict[str, Real]) -> Real:
    """Place of each node, m, (n_nodes, 3): its point, else the first joint that names it; base frame."""
    places = np.zeros((robot.n_nodes, 3))
    for joint in reversed(robot.joints):
        places[list(joint.nodes)] = frames[joint.frame][:3, 3]
    for node, (name, place) in robot.points.items():
        places[node] = frames[name][:3, :3] @ place + frames[name][:3, 3]
    return places


def rigid_arms(robot: SpatialRobot, structure: Structure) -> tuple[str, ...]:
    """List joints that share a node but stand apart: the part between them is taken as rigid, one sentence a pair."""
    found = []
    for node in range(robot.n_nodes):
        here = [
            (joint.frame, spring.place)
            for joint, spring in zip(robot.joints, structure.springs, strict=True)
            if node in joint.nodes
        ]
        for (first, place), (second, other) in pairwise(here):
            apart = float(np.linalg.norm(place - other))
            if apart > 1e-6:
                found.append(
                    f"joints {first} and {second} share node {node} and stand {apart:.3g} m apart: the body between "
                    "them is taken as rigid; give each its own node and a [[links]] tube between them if it is not"
                )
    return tuple(found)


def _divide(link: Link, frames: dict[str, Real], places: Real, beams: list[Beam], extra: list[Real]) -> None:
    """Beam elements of one link; nodes between are numbered after all others."""
    assert link.section is not None
    start, end = places[link.nodes[0]], places[link.nodes[1]]
    axes = _axes(link, frames, end - start)
    inner = [len(places) + len(extra) + i for i in range(link.elements - 1)]
    extra += [(start + (end - start) * (i + 1) / link.elements)[None] for i in range(link.elements - 1)]
    chain = [link.nodes[0], *inner, link.nodes[1]]
    beams += [Beam(pair, axes, link.section) for pair in pairwise(chain)]


def _axes(link: Link, frames: dict[str, Real], along: Real) -> Real:
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
    """``Rot(x, delta) Rot(y, eta) Rot(z, kappa)``, shape (3, 3) (Belchior et al. 2013, Eq. 2).

    Examples
    --------
    >>> link_rotation(0.0, np.pi / 2, 0.0)[:, 0].round(12).tolist()
    [0.0, 0.0, -1.0]
    """
    (cx, sx), (cy, sy), (cz, sz) = ((np.cos(angle), np.sin(angle)) for angle in (delta, eta, kappa))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_x @ about_y @ about_z)


def _body(body: LumpedBody, axes: Real) -> Body:
    return Body(body.node, body.mass, axes @ body.centre, axes @ body.inertia @ axes.T)
