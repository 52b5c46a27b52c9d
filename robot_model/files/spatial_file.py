"""Robots in space from their files."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, inf, radians

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from foundation import InputError

from ..finite_elements import Material, Section, hollow_circle, rayleigh_constants
from ..kinematics import LARGEST_TRAVEL, Frame, Mechanism, named_values
from ..serial_chains import inertia_fault, symmetric
from ..spatial import ElasticJoint, Link, LumpedBody, SpatialRobot, check_tip
from ..uncertain_robot import RobotUncertainty
from .drive_table import DriveKeys, drive_of
from .robot_files import Table, read_as
from .update_table import UpdateTable, left_open, uncertainty_of


class _Head(Table):
    """The table ``[robot]``.

    Parameters
    ----------
    name
        Name of the robot.
    kind
        ``serial``, ``spatial`` or ``planar``: which tables the file has.
    gravity_m_per_s2 : m/s^2
        Gravity as a stiffness of the structure; 0: left out.
    up
        Axis of the base against the weight: ``[0, 0, 1]`` stands on the floor, ``[0, 0, -1]`` hangs from a ceiling.
    repeatability_m : m
        Pose repeatability after ISO 9283 (RP).
    tip_node
        Node of the tool's tip; it stands at the origin of ``tool_frame``.
    tool_frame
        Frame of the tool, z along it.
    """

    name: str
    kind: str
    tip_node: int
    tool_frame: str
    gravity_m_per_s2: float = Field(0.0, ge=0, le=30)
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    repeatability_m: float | None = Field(None, gt=0, le=0.01)


class _Frame(Table):
    """A row ``[[frames]]``, after Khalil and Kleinfinger.

    Parameters
    ----------
    name
        Name of the frame.
    antecedent
        Frame before it; ``0`` is the base.
    motion
        ``revolute``, ``prismatic`` or ``fixed``.
    active
        False: the joint follows from a closed loop.
    gamma_deg, alpha_deg, theta_deg : deg
        Angles gamma, alpha and theta; theta is the zero of a revolute joint.
    b_m, d_m, r_m : m
        Lengths b, d and r; r is the zero of a prismatic joint.
    limits_deg : deg
        Least and largest angle.
    limits_m : m
        Least and largest travel.
    """

    name: str
    antecedent: str
    motion: str = "revolute"
    active: bool = True
    gamma_deg: float = 0.0
    b_m: float = 0.0
    alpha_deg: float = 0.0
    d_m: float = 0.0
    theta_deg: float = 0.0
    r_m: float = 0.0
    limits_deg: tuple[float, float] | None = None
    limits_m: tuple[float, float] | None = None


class _Joint(DriveKeys):
    """A row ``[[joints]]``: springs and dampers between two nodes, in the axes of a frame.

    Parameters
    ----------
    frame
        Frame whose z is the axis of the joint.
    nodes
        Node before and node after the joint.
    radial_n_per_m, axial_n_per_m : N/m
        Stiffness of the bearing across and along the joint's axis; left out: rigid.
    tilting_nm_per_rad : N m/rad
        Stiffness of the bearing against tilting of the axis; left out: rigid.
    turning_nm_per_rad : N m/rad
        Stiffness about the axis: the gear of a revolute joint.
    damping_nms_per_rad : N m s/rad
        Viscous damping about the axis.
    damping_ns_per_m : N s/m
        Viscous damping along the axis.
    """

    frame: str
    nodes: tuple[int, int]
    radial_n_per_m: float | None = Field(None, gt=0)
    axial_n_per_m: float | None = Field(None, gt=0)
    tilting_nm_per_rad: float | None = Field(None, gt=0)
    turning_nm_per_rad: float | None = Field(None, gt=0)
    damping_nms_per_rad: float = 0.0
    damping_ns_per_m: float = 0.0


class _Tube(Table):
    """The table ``[links.tube]``: a round hollow beam.

    Parameters
    ----------
    outer_m, inner_m : m
        Outer and inner diameter.
    young_pa, shear_pa : Pa
        Young's and shear modulus.
    density_kg_per_m3 : kg/m^3
        Density of the material.
    theory
        ``timoshenko`` or ``euler-bernoulli``.
    """

    outer_m: float
    inner_m: float = 0.0
    young_pa: float = Field(gt=0)
    shear_pa: float = Field(gt=0)
    density_kg_per_m3: float = Field(gt=0)
    theory: str = "timoshenko"


class _Link(Table):
    """A row ``[[links]]``: a beam or a rigid link between two nodes.

    Parameters
    ----------
    nodes
        Its two nodes.
    tube
        Section and material of a beam; left out: rigid.
    elements
        Number of finite elements of the beam.
    frame
        Frame whose axes, turned by ``angles_deg``, are those of the section.
    angles_deg : deg
        Turns about x, y and z.
    """

    nodes: tuple[int, int]
    tube: _Tube | None = None
    elements: int = Field(1, ge=1)
    frame: str | None = None
    angles_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)


class _Point(Table):
    """A row ``[[points]]``: a node at no joint.

    Parameters
    ----------
    node
        Number of the node; node 0 is clamped.
    frame
        Frame with which it moves.
    at_m : m
        Its place in that frame.
    """

    node: int
    frame: str
    at_m: tuple[float, float, float]


class _Body(Table):
    """A row ``[[bodies]]``: a rigid body at a node.

    Parameters
    ----------
    node
        Node that carries it.
    frame
        Frame in whose axes centre and inertia are told.
    mass_kg : kg
        Mass of the body.
    centre_m : m
        Centre of mass.
    inertia_kg_m2 : kg m^2
        Inertia about the centre: ``xx yy zz``, or ``xx yy zz xy xz yz``.
    """

    node: int
    frame: str
    mass_kg: float
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia_kg_m2: tuple[float, float, float] | tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0)


class Damping(Table):
    """Either two ratios at two frequencies (Rayleigh), or one ratio for all modes.

    Parameters
    ----------
    frequencies_hz : Hz
        Two frequencies at which the ``ratios`` hold (Rayleigh).
    ratios
        Damping ratios there.
    ratio
        One damping ratio for all modes, instead.
    """

    frequencies_hz: tuple[float, float] | None = None
    ratios: tuple[float, float] | None = None
    ratio: float | None = Field(None, ge=0, lt=1)


class _Closure(Table):
    """A row ``[[closures]]``: where a loop was cut.

    Parameters
    ----------
    frames
        Two frames that coincide.
    """

    frames: tuple[str, str]


class Pose(Table):
    """A posture: ``driven`` in degrees, of prismatic joints in metres; ``driven_deg`` is its older name.

    Parameters
    ----------
    name
        Name of the posture.
    driven : deg; prismatic joints m
        Values of the driven joints in the order of the frames.
    driven_deg : deg
        Older name of ``driven``.
    """

    name: str
    driven: list[float] | None = None
    driven_deg: list[float] | None = None


class SpatialFile(BaseModel):
    """A robot file of kind ``spatial``.

    Parameters
    ----------
    robot
        The robot as a whole.
    frames
        Kinematics, frame by frame.
    closures
        Where loops were cut.
    joints
        Springs and dampers of the joints.
    links
        Beams and rigid links between nodes.
    points
        Nodes at no joint.
    bodies
        Rigid bodies; without them a robot has statics only.
    damping
        Damping of the structure.
    poses
        Named postures; the first is the default.
    update
        What ``millfrf robot update`` changed and left open; written by it.
    """

    model_config = ConfigDict(extra="forbid")

    robot: _Head
    frames: list[_Frame]
    closures: list[_Closure] = []
    joints: list[_Joint]
    links: list[_Link] = []
    points: list[_Point] = []
    bodies: list[_Body] = []
    damping: Damping | None = None
    poses: list[Pose] = []
    update: UpdateTable | None = None


@dataclass(frozen=True)
class SpatialCase:
    """A robot in space as its file describes it.

    Parameters
    ----------
    name
        Name of the robot.
    robot
        The robot as a structure and mechanism.
    poses
        Driven joint values by name, rad and (prismatic joints) m.
    repeatability : m
        Pose repeatability after ISO 9283 (RP: radius of the sphere); None: the file does not tell it.
    assumed
        What the file marks as assumed and what decides results: one sentence each, for the warnings of every result.
    uncertainty
        What an update left open of the file's numbers; None: the file was never updated.
    """

    name: str
    robot: SpatialRobot
    poses: dict[str, NDArray[np.float64]]
    repeatability: float | None = None
    assumed: tuple[str, ...] = ()
    uncertainty: RobotUncertainty | None = None


def read_spatial_robot(robot: str | os.PathLike[str]) -> SpatialCase:
    """Read a robot of kind ``spatial``, by path or by name.

    Raises
    ------
    InputError
        No such robot, or frames and nodes that do not fit together.
    FileFormatError
        Not a robot in space, or a key unknown, missing or of the wrong type.
    """
    content = read_as(SpatialFile, robot, "spatial")
    try:
        return _case(content)
    except InputError as error:
        raise InputError(f"{robot}: {error}") from error


def _case(content: SpatialFile) -> SpatialCase:
    nodes = [row.node for row in content.points]
    for node in nodes:
        if nodes.count(node) > 1:
            raise InputError(f"[[points]] place node {node} twice; place it once")
    frames = tuple(_frame(row) for row in content.frames)
    closures = tuple(closure.frames for closure in content.closures)
    spatial = SpatialRobot(
        mechanism=Mechanism(frames, content.robot.tool_frame, closures),
        joints=tuple(_joint(row, frames) for row in content.joints),
        links=tuple(_link(row) for row in content.links),
        bodies=tuple(_body(row) for row in content.bodies),
        points={row.node: (row.frame, np.array(row.at_m)) for row in content.points},
        tip=content.robot.tip_node,
        rayleigh=rayleigh_of(content.damping),
        damping_ratio=None if content.damping is None else content.damping.ratio,
        gravity=content.robot.gravity_m_per_s2,
        up=upwards(content.robot.up),
    )
    check_tip(spatial)
    poses = named_postures(content.poses, spatial.mechanism)
    _check_masses(content.bodies)
    uncertainty = None if content.update is None else uncertainty_of(content.update)
    assumed = () if content.update is None else left_open(content.update)
    return SpatialCase(content.robot.name, spatial, poses, content.robot.repeatability_m, assumed, uncertainty)


def _check_masses(rows: list[_Body]) -> None:
    """A negative mass is what another body of its node has too much; what is left must be one."""
    for number, row in enumerate(rows, start=1):
        left = sum(other.mass_kg for other in rows if other.node == row.node)
        if (row.mass_kg < 0 and left <= -0.5) or row.mass_kg == 0:
            raise InputError(
                f"bodies[{number}].mass_kg must be above 0, not {row.mass_kg!r}; a negative mass stands for what "
                f"another body of node {row.node} has too much, and {left:g} kg are left there"
            )


def upwards(given: tuple[float, float, float]) -> tuple[float, float, float]:
    """Unit vector against weight."""
    length = hypot(*given)
    if not length > 0:
        raise InputError(f"up = {list(given)} has no direction; give the base frame's axis against weight: [0, 0, 1]")
    return given[0] / length, given[1] / length, given[2] / length


def named_postures(poses: Sequence[Pose], mechanism: Mechanism) -> dict[str, NDArray[np.float64]]:
    """Postures of a file by name, rad and m."""
    typed = []
    for pose in poses:
        given = [values for values in (pose.driven, pose.driven_deg) if values is not None]
        if len(given) != 1:
            raise InputError(f"posture {pose.name!r}: give driven = [...] once: degrees, prismatic joints in metres")
        typed.append((pose.name, given[0]))
    return named_values(mechanism, typed)


def rayleigh_of(damping: Damping | None) -> tuple[float, float]:
    """Rayleigh's constants of a file's damping, 1/s and s; zero where it gives one ratio."""
    if damping is None:
        return (0.0, 0.0)
    if damping.ratio is not None:
        if damping.ratios is not None or damping.frequencies_hz is not None:
            raise InputError("damping: give one ratio, or frequencies_hz and ratios (two each), not both")
        return (0.0, 0.0)
    if damping.frequencies_hz is None or damping.ratios is None:
        raise InputError("damping: give frequencies_hz and ratios (two each), or one ratio")
    if not all(0 <= ratio < 1 for ratio in damping.ratios):
        raise InputError(f"damping: ratios = {list(damping.ratios)} must be 0 or more and below 1; 4 % is 0.04")
    return rayleigh_constants(damping.frequencies_hz, damping.ratios)


def _frame(row: _Frame) -> Frame:
    lower, upper = _limits(row)
    return Frame(
        row.name,
        row.antecedent,
        row.motion,
        row.active,
        radians(row.gamma_deg),
        row.b_m,
        radians(row.alpha_deg),
        row.d_m,
        radians(row.theta_deg),
        row.r_m,
        lower,
        upper,
    )


def _limits(row: _Frame) -> tuple[float, float]:
    """Limits in rad or m, by the frame's motion."""
    if row.motion == "prismatic":
        given, wrong, right = row.limits_m, row.limits_deg, "limits_m"
    else:
        given, wrong, right = row.limits_deg, row.limits_m, "limits_deg"
    if wrong is not None or (given is not None and row.motion == "fixed"):
        remedy = "leave its limits out" if row.motion == "fixed" else f"give {right}"
        raise InputError(f"frame {row.name}: limits {list(wrong or given or ())} of a {row.motion} frame; {remedy}")
    if given is None:
        return (-inf, inf)
    if row.motion == "revolute":
        return radians(given[0]), radians(given[1])
    if max(map(abs, given)) > LARGEST_TRAVEL:
        raise InputError(f"frame {row.name}: limits_m = {list(given)}: give metres, at most {LARGEST_TRAVEL:g}")
    return given


def _joint(row: _Joint, frames: tuple[Frame, ...]) -> ElasticJoint:
    """A joint; its damping has the unit of its motion."""
    frame = next((frame for frame in frames if frame.name == row.frame), None)
    slides = frame is not None and frame.motion == "prismatic"
    wrong = row.damping_nms_per_rad if slides else row.damping_ns_per_m
    if wrong:
        given, wanted = ("damping_nms_per_rad", "damping_ns_per_m")[:: 1 if slides else -1]
        raise InputError(f"joint {row.frame}: {given} = {wrong:g} has not the unit of its motion; give {wanted}")
    damping = row.damping_ns_per_m if slides else row.damping_nms_per_rad
    return ElasticJoint(row.frame, row.nodes, _stiffness(row), drive_of(row, frame), damping)


def _stiffness(row: _Joint) -> NDArray[np.float64]:
    """A stiffness that is not given is infinite: the joint is rigid in that direction."""
    radial, axial, tilting, turning = (
        inf if value is None else value
        for value in (row.radial_n_per_m, row.axial_n_per_m, row.tilting_nm_per_rad, row.turning_nm_per_rad)
    )
    return np.array([radial, radial, axial, tilting, tilting, turning])


def _link(row: _Link) -> Link:
    if row.frame is None and any(row.angles_deg):
        raise InputError(f"link {list(row.nodes)}: angles_deg turn a frame; give its name too, frame = ...")
    if row.tube is None and row.elements > 1:
        raise InputError(
            f"link {list(row.nodes)}: elements = {row.elements} of a rigid link; give it a tube, or leave it"
        )
    section = None if row.tube is None else _section(row.tube)
    delta, eta, kappa = (radians(angle) for angle in row.angles_deg)
    return Link(row.nodes, section, row.elements, row.frame, (delta, eta, kappa))


def _section(tube: _Tube) -> Section:
    if tube.theory not in ("timoshenko", "euler-bernoulli"):
        raise InputError(f"beam theory {tube.theory!r} is none of timoshenko, euler-bernoulli")
    material = Material(tube.young_pa, tube.shear_pa, tube.density_kg_per_m3)
    return hollow_circle(tube.outer_m, tube.inner_m, material, timoshenko=tube.theory == "timoshenko")


def _body(row: _Body) -> LumpedBody:
    inertia = symmetric(row.inertia_kg_m2)
    fault = inertia_fault(inertia)
    if fault is not None:
        raise InputError(f"body at node {row.node}: inertia_kg_m2 = {list(row.inertia_kg_m2)}: {fault}")
    return LumpedBody(row.node, row.frame, row.mass_kg, np.array(row.centre_m), inertia)
