"""`SpatialRobot`: a mechanism with the compliance and mass of its joints, links and bodies."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from foundation import InputError

from ..finite_elements import Beam, Body, Section, Spring, Structure, cross_matrix, gravity_stiffness
from ..kinematics import Mechanism, drive_direction
from .drive_nodes import with_rotors
from .joint_drive import JointDrive
from .robot_check import check_robot

Real = NDArray[np.float64]


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

    def with_stiffness(self, stiffness: Real) -> "SpatialRobot":
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
