"""Changes of a robot's model: one number each, with companion numbers where a change needs several."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from millfrf.core import InputError, Real

from ..finite_elements.beam_element import Section
from ..spatial.spatial_modes import housing_node
from ..spatial.spatial_robot import LumpedBody, SpatialRobot, structure_at


class _FittedNumber:
    """Conversion of a number to the coordinate in which it is fitted, and back."""

    bounds: tuple[float, float]
    scale: float
    logarithmic: bool

    def to_fit(self, number: float) -> float:
        """Return the fitted coordinate of a number: ``asinh(number / scale)``, its logarithm, or the number itself."""
        if self.scale:
            return float(np.arcsinh(number / self.scale))
        return float(np.log(number)) if self.logarithmic else number

    def from_fit(self, coordinate: float) -> float:
        """Return the number of a coordinate, clipped to its bounds."""
        number = coordinate
        # the coordinate is limited first: sinh and exp overflow beyond 710
        if self.scale:
            number = self.scale * float(np.sinh(np.clip(coordinate, -50.0, 50.0)))
        elif self.logarithmic:
            number = float(np.exp(min(coordinate, 700.0)))
        return float(np.clip(number, *self.bounds))

    def slope(self, number: float) -> float:
        """Return the derivative of the number with respect to its coordinate."""
        if self.scale:
            return float(np.hypot(number, self.scale))
        return number if self.logarithmic else 1.0


@dataclass(frozen=True)
class Companion(_FittedNumber):
    """A number that is fitted together with a change and has a prior, such as a place or a second direction.

    Parameters
    ----------
    name, unit
        Name and unit of the number, for people.
    bounds
        Lowest and highest value of the number, in ``unit``.
    centre, spread
        Mean and standard deviation of the prior, in ``unit``.
    scale
        Size of the number at which its coordinate ``asinh(number / scale)`` turns from linear to logarithmic.
    """

    name: str
    unit: str
    bounds: tuple[float, float]
    centre: float
    spread: float
    scale: float = 1.0

    logarithmic = False

    @property
    def neutral(self) -> float:
        """Return the number from which a fit starts, the mean of the prior."""
        return float(np.clip(self.centre, *self.bounds))


@dataclass(frozen=True)
class Change(_FittedNumber):
    """One hypothesis about what is wrong in a robot's model: a number and, where needed, companion numbers.

    Parameters
    ----------
    name
        ``joint 3 stiffness``, ``links``, ``payload``, ``tool compliance``, ``posture of joint 3``, ``gravity``,
        ``damping``.
    kind
        ``stiffness``, ``links``, ``payload``, ``tool``, ``posture``, ``gravity``, ``damping`` or ``mass``.
    unit
        Unit of the number; "" for a factor.
    logarithmic
        Whether the number is positive and is fitted by its logarithm.
    values
        Numbers from which a search starts, from small to large change.
    bounds
        Lowest and highest value of the number, in ``unit``.
    neutral
        Number at which the change has almost no effect.
    apply
        Function that takes a robot, the number and the companions' numbers and returns the changed robot. Companions
        that are omitted are neutral. None: the change turns a joint and leaves the robot as it is.
    scale
        Scale of the number. Where it is positive, the number may have either sign and is fitted as
        ``asinh(number / scale)``.
    companions
        Further numbers that are fitted together with this number.
    joint
        Column of the joint that a ``posture`` change turns, among the moving joints.
    """

    name: str
    kind: str
    unit: str
    logarithmic: bool
    values: tuple[float, ...]
    bounds: tuple[float, float]
    neutral: float
    apply: Callable[..., SpatialRobot] | None
    scale: float = 0.0
    companions: tuple[Companion, ...] = ()
    joint: int = -1


Numbered = tuple[Change | Companion, float]  # a change or a companion with its number; companions follow their change


def with_joint_factor(robot: SpatialRobot, frame: str, factor: float) -> SpatialRobot:
    """Multiply every finite stiffness of one joint by a factor.

    Parameters
    ----------
    robot
        Robot whose joint is changed.
    frame
        Name of the joint's frame.
    factor
        Factor on the stiffnesses of the joint.

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
    """Add a point mass to the spindle: on the tool's node, or before the tool's spring where the robot has one.

    Parameters
    ----------
    robot
        Robot that carries the mass.
    mass : kg
        Mass of the payload, positive.
    centre : (3,), m, or None
        Place of the mass from the tip, in the tool frame; None: at the tip.

    Raises
    ------
    InputError
        A mass that is not positive.
    """
    if not mass > 0:
        raise InputError(f"payload {mass!r} kg must be positive")
    place = np.zeros(3) if centre is None else np.asarray(centre, dtype=float)
    body = LumpedBody(housing_node(robot), robot.mechanism.tool, mass, place, np.zeros((3, 3)))
    return replace(robot, bodies=(*robot.bodies, body))


def end_bodies(robot: SpatialRobot) -> tuple[int, ...]:
    """Indices of the bodies that the last joint carries: spindle, holder, tool."""
    mechanism = robot.mechanism
    carried = {mechanism.frames[mechanism.moving[-1]].name}
    for frame in mechanism.frames:
        if frame.antecedent in carried and frame.motion == "fixed":
            carried.add(frame.name)
    return tuple(i for i, body in enumerate(robot.bodies) if body.frame in carried)


def with_lighter_end(robot: SpatialRobot, mass: float, place: Real | None = None) -> SpatialRobot:
    """Take ``mass`` (kg) off the heaviest body that the last joint carries: the spindle is lighter than modelled.

    The centre moves to ``(M c - m p) / (M - m)``. ``place`` p (3,) is the place of the removed mass from the tip, in
    the tool frame, m; None: at the body's centre, which stays.
    """
    index = max(end_bodies(robot), key=lambda i: robot.bodies[i].mass, default=None)
    if index is None or not 0 < mass < robot.bodies[index].mass:
        heaviest = 0.0 if index is None else robot.bodies[index].mass
        raise InputError(
            f"{mass!r} kg cannot be taken off: the heaviest body after the last joint has {heaviest:g} kg; "
            "give a positive mass below it"
        )
    body = robot.bodies[index]
    left = body.mass - mass
    centre = body.centre
    if place is not None:
        centre = (body.mass * body.centre - mass * _from_node(robot, body, place)) / left
    # the inertia is scaled with the mass: subtracting m p^2 could leave a body with a negative moment
    lighter = replace(body, mass=left, centre=centre, inertia=body.inertia * left / body.mass)
    return replace(robot, bodies=(*robot.bodies[:index], lighter, *robot.bodies[index + 1 :]))


def _from_node(robot: SpatialRobot, body: LumpedBody, place: Real) -> Real:
    """Convert a place relative to the tip (tool frame, m) to a place relative to a body's node (body frame, m)."""
    mechanism, reference = robot.mechanism, np.zeros(len(robot.mechanism.moving))
    placed = mechanism.transforms(reference)
    tool, own = placed[mechanism.index(mechanism.tool)], placed[mechanism.index(body.frame)]
    node = structure_at(robot, reference).positions[body.node]
    return np.asarray(own[:3, :3].T @ (tool[:3, :3] @ place + tool[:3, 3] - node))


def with_link_factor(robot: SpatialRobot, factor: float) -> SpatialRobot:
    """Multiply the stiffness of every flexible link by a factor; masses stay."""

    def scaled(section: Section) -> Section:
        stiff = ("axial", "bending_y", "bending_z", "torsion", "shear_y", "shear_z")
        return replace(section, **{name: factor * getattr(section, name) for name in stiff})

    links = tuple(link if link.section is None else replace(link, section=scaled(link.section)) for link in robot.links)
    return replace(robot, links=links)


def with_damping_factor(robot: SpatialRobot, factor: float) -> SpatialRobot:
    """Multiply the damping of every mode by a factor, whether it is Rayleigh damping or one ratio."""
    if not factor > 0:
        raise InputError(f"damping factor {factor!r} must be positive")
    a, b = robot.rayleigh
    ratio = None if robot.damping_ratio is None else factor * robot.damping_ratio
    return replace(robot, rayleigh=(factor * a, factor * b), damping_ratio=ratio)


def with_rigid_links(robot: SpatialRobot) -> SpatialRobot:
    """Replace flexible links by rigid ones of the same mass and inertia, so that only the joints are elastic.

    A uniform beam becomes a body at its middle with ``m L^2 / 12 + rho I L`` across and ``rho I_p L`` along.
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
        arm = axes[owner[node]].T @ (positions[link.nodes[1]] - positions[node])
        bodies.append(_rigid_beam(node, owner[node], arm, link.section))
    return replace(robot, links=tuple(replace(link, section=None) for link in robot.links), bodies=tuple(bodies))


def _rigid_beam(node: int, frame: str, arm: Real, section: Section) -> LumpedBody:
    length = float(np.sqrt(arm @ arm))
    along = np.outer(arm, arm) / length**2
    across = section.mass * length**3 / 12 + section.rotary_z * length
    inertia = across * (np.eye(3) - along) + section.polar * length * along
    return LumpedBody(node, frame, section.mass * length, arm / 2, inertia)
