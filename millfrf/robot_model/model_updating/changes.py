"""Single changes of a robot's model: one parameter, and its companions."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real

from ..finite_elements.beam_element import Section
from ..spatial.spatial_modes import housing_node
from ..spatial.spatial_robot import LumpedBody, SpatialRobot, structure_at

Changed = tuple[SpatialRobot, Real]
"""A robot, and by how much its joints stand elsewhere than was said, rad, (n_moving,)."""


@dataclass(frozen=True)
class Companion:
    """A number that is fitted beside a change's own, with a prior belief: a place, a second direction.

    Parameters
    ----------
    name, unit
        Name and unit of the number, for people.
    bounds
        Lowest and highest value of the number, in ``unit``.
    centre, spread
        Mean and standard deviation of the belief.
    scale
        Size of the number at which its coordinate ``asinh(number / scale)`` turns from linear to logarithmic.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    centre: float
    spread: float
    scale: float = 1.0

    @property
    def neutral(self) -> float:
        """Number from which a fit starts."""
        return float(np.clip(self.centre, *self.bounds))

    def to_fit(self, number: float) -> float:
        """Coordinate in which it is fitted."""
        return float(np.arcsinh(number / self.scale))

    def from_fit(self, coordinate: float) -> float:
        """Back to the number, kept within its bounds."""
        return float(np.clip(self.scale * np.sinh(np.clip(coordinate, -50.0, 50.0)), *self.bounds))

    def slope(self, number: float) -> float:
        """Derivative of the number by its coordinate."""
        return float(np.hypot(number, self.scale))


@dataclass(frozen=True)
class Change:
    """One thing that may be wrong, with one number and, where it needs them, companions of that number.

    Parameters
    ----------
    name
        ``joint 3 stiffness``, ``links``, ``payload``, ``tool compliance``, ``posture of joint 3``, ``gravity``,
        ``damping``.
    kind
        ``stiffness``, ``links``, ``payload``, ``tool``, ``posture``, ``gravity`` or ``damping``.
    unit
        Unit of the number; "" for a factor.
    logarithmic
        Whether the number is positive and is fitted by its logarithm.
    values
        Numbers from which a search starts, from small to large change.
    bounds
        Lowest and highest value of the number, in ``unit``.
    neutral
        Number at which next to nothing is changed.
    apply
        Function that takes a robot, the number and the companions' numbers (their neutral ones where left out) and
        gives the changed robot and the offset of its joints.
    scale
        Scale of the number. Where it is positive, the number may have both signs and is fitted as ``asinh(number /
        scale)``.
    companions
        Further numbers that are fitted with it.
    """

    name: str
    kind: str
    unit: str
    logarithmic: bool
    values: tuple[float, ...]
    bounds: tuple[float, float]
    neutral: float
    apply: Callable[..., Changed]
    scale: float = 0.0
    companions: tuple[Companion, ...] = ()

    def to_fit(self, number: float) -> float:
        """Coordinate in which it is fitted: ln, asinh, or the number itself."""
        if self.scale:
            return float(np.arcsinh(number / self.scale))
        return float(np.log(number)) if self.logarithmic else number

    def from_fit(self, coordinate: float) -> float:
        """Back to the number, kept within its bounds."""
        number = coordinate
        if self.scale:
            number = self.scale * float(np.sinh(np.clip(coordinate, -50.0, 50.0)))
        elif self.logarithmic:
            number = float(np.exp(min(coordinate, 700.0)))
        return float(np.clip(number, *self.bounds))

    def slope(self, number: float) -> float:
        """Derivative of the number by its coordinate."""
        if self.scale:
            return float(np.hypot(number, self.scale))
        return number if self.logarithmic else 1.0


Numbered = tuple[Change | Companion, float]
"""A change or a companion with its number; companions follow their change."""


def with_joint_factor(robot: SpatialRobot, frame: str, factor: float) -> SpatialRobot:
    """Every finite stiffness of one joint times ``factor``.

    Raises
    ------
    InputError
        No joint at that frame.
    """
    if all(joint.frame != frame for joint in robot.joints):
        raise InputError(f"no joint at frame {frame!r}; there are {', '.join(joint.frame for joint in robot.joints)}")
    scale = [factor if joint.frame == frame else 1.0 for joint in robot.joints]
    return robot.with_stiffness(np.array([f * joint.stiffness for f, joint in zip(scale, robot.joints, strict=True)]))


def with_payload(robot: SpatialRobot, mass: float, centre: Real | None = None) -> SpatialRobot:
    """A further point mass (kg) on the spindle, ``centre`` (3,) from the tip in the tool frame, m.

    It sits on the tool's node, or before the tool's spring where the robot has one.
    """
    if not mass > 0:
        raise InputError(f"payload {mass!r} kg must be positive")
    place = np.zeros(3) if centre is None else np.asarray(centre, dtype=float)
    body = LumpedBody(housing_node(robot), robot.mechanism.tool, mass, place, np.zeros((3, 3)))
    return replace(robot, bodies=(*robot.bodies, body))


def end_bodies(robot: SpatialRobot) -> tuple[int, ...]:
    """Indices of the bodies that the last joint carries: spindle, holder, tool."""
    mechanism = robot.mechanism
    last = mechanism.frames[mechanism.moving[-1]].name
    carried = {last}
    for frame in mechanism.frames:
        if frame.antecedent in carried and frame.motion == "fixed":
            carried.add(frame.name)
    return tuple(i for i, body in enumerate(robot.bodies) if body.frame in carried)


def with_lighter_end(robot: SpatialRobot, mass: float, place: Real | None = None) -> SpatialRobot:
    """Take ``mass`` (kg) off the heaviest body that the last joint carries: a spindle lighter than modelled.

    Its centre moves to ``(M c - m p) / (M - m)``, its inertia about the centre is taken as ``(M - m) / M`` of what it
    was, so that the body stays a possible one.

    Parameters
    ----------
    robot
        Robot as modelled.
    mass : kg
        Mass that is taken away.
    place : (3,), m
        Place of that mass from the tool tip, in the tool frame; None: at the body's centre, which stays.

    Raises
    ------
    InputError
        The last joint carries no body that is so heavy.
    """
    ends = end_bodies(robot)
    index = max(ends, key=lambda i: robot.bodies[i].mass, default=None)
    if index is None or not 0 < mass < robot.bodies[index].mass:
        heaviest = 0.0 if index is None else robot.bodies[index].mass
        raise InputError(f"{mass!r} kg less than {heaviest:g} kg, the heaviest body after the last joint, is no body")
    body = robot.bodies[index]
    left = body.mass - mass
    centre = body.centre
    if place is not None:
        centre = (body.mass * body.centre - mass * _from_node(robot, body, place)) / left
    lighter = replace(body, mass=left, centre=centre, inertia=body.inertia * left / body.mass)
    return replace(robot, bodies=(*robot.bodies[:index], lighter, *robot.bodies[index + 1 :]))


def _from_node(robot: SpatialRobot, body: LumpedBody, place: Real) -> Real:
    """A place told from the tip in the tool frame, from a body's node in the body's frame."""
    mechanism, reference = robot.mechanism, np.zeros(len(robot.mechanism.moving))
    placed = mechanism.transforms(reference)
    tool, own = placed[mechanism.index(mechanism.tool)], placed[mechanism.index(body.frame)]
    node = structure_at(robot, reference).positions[body.node]
    return np.asarray(own[:3, :3].T @ (tool[:3, :3] @ place + tool[:3, 3] - node))


def with_link_factor(robot: SpatialRobot, factor: float) -> SpatialRobot:
    """Every flexible link's stiffness times ``factor``, its mass kept."""

    def scaled(section: Section) -> Section:
        stiff = ("axial", "bending_y", "bending_z", "torsion", "shear_y", "shear_z")
        return replace(section, **{name: factor * getattr(section, name) for name in stiff})

    links = tuple(link if link.section is None else replace(link, section=scaled(link.section)) for link in robot.links)
    return replace(robot, links=links)


def with_damping_factor(robot: SpatialRobot, factor: float) -> SpatialRobot:
    """Damping of every mode times ``factor``, whether it is Rayleigh's or one ratio."""
    if not factor > 0:
        raise InputError(f"damping factor {factor!r} must be positive")
    a, b = robot.rayleigh
    ratio = None if robot.damping_ratio is None else factor * robot.damping_ratio
    return replace(robot, rayleigh=(factor * a, factor * b), damping_ratio=ratio)


def with_rigid_links(robot: SpatialRobot) -> SpatialRobot:
    """Flexible links made rigid, with the mass and inertia that they had: joints alone give way.

    A uniform beam is a body at its middle with ``m L^2 / 12 + rho I L`` across and ``rho I_p L`` along.
    """
    reference = np.zeros(len(robot.mechanism.moving))
    positions = structure_at(robot, reference).positions
    placed = robot.mechanism.transforms(reference)
    axes = {frame.name: placed[i, :3, :3] for i, frame in enumerate(robot.mechanism.frames)} | {"0": np.eye(3)}
    owner = {node: name for node, (name, _) in robot.points.items()}
    owner |= {joint.nodes[1]: joint.frame for joint in robot.joints}
    bodies = list(robot.bodies)
    for link in robot.links:
        if link.section is None:
            continue
        node = link.nodes[0]
        if node not in owner:
            raise InputError(f"link {link.nodes}: its first node is on no body; let links start after a joint")
        turn = axes[owner[node]]
        arm = turn.T @ (positions[link.nodes[1]] - positions[node])
        bodies.append(_rigid_beam(node, owner[node], arm, link.section))
    return replace(robot, links=tuple(replace(link, section=None) for link in robot.links), bodies=tuple(bodies))


def _rigid_beam(node: int, frame: str, arm: Real, section: Section) -> LumpedBody:
    length = float(np.sqrt(arm @ arm))
    along = np.outer(arm, arm) / length**2
    across = section.mass * length**3 / 12 + section.rotary_z * length
    inertia = across * (np.eye(3) - along) + section.polar * length * along
    return LumpedBody(node, frame, section.mass * length, arm / 2, inertia)
