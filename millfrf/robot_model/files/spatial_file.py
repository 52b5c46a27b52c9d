"""Robots in space, read from their files."""

import os
from dataclasses import dataclass
from math import inf, radians

import numpy as np
from numpy.typing import NDArray

from millfrf.core import InputError

from ..finite_elements.beam_element import Material, Section, hollow_circle
from ..kinematics.joint_values import LARGEST_TRAVEL
from ..kinematics.mechanism import Frame, Mechanism
from ..serial_chains.serial_chain import inertia_fault, symmetric
from ..spatial.spatial_modes import check_tip
from ..spatial.spatial_robot import ElasticJoint, Link, LumpedBody, SpatialRobot
from ..uncertain_robot.bands import RobotUncertainty
from .common_tables import drive_of, left_open, named_postures, rayleigh_of, uncertainty_of, upwards
from .robot_files import read_as
from .spatial_tables import BodyRow, FrameRow, JointRow, LinkRow, SpatialFile, TubeTable


def frame_of(row: FrameRow) -> Frame:
    """A frame with angles in rad."""
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


def _limits(row: FrameRow) -> tuple[float, float]:
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


def joint_of(row: JointRow, frames: tuple[Frame, ...]) -> ElasticJoint:
    """A joint; its damping has the unit of its motion."""
    frame = next((frame for frame in frames if frame.name == row.frame), None)
    slides = frame is not None and frame.motion == "prismatic"
    wrong = row.damping_nms_per_rad if slides else row.damping_ns_per_m
    if wrong:
        given, wanted = ("damping_nms_per_rad", "damping_ns_per_m")[:: 1 if slides else -1]
        raise InputError(f"joint {row.frame}: {given} = {wrong:g} has not the unit of its motion; give {wanted}")
    damping = row.damping_ns_per_m if slides else row.damping_nms_per_rad
    return ElasticJoint(row.frame, row.nodes, _stiffness(row), drive_of(row, frame), damping)


def _stiffness(row: JointRow) -> NDArray[np.float64]:
    """A stiffness that is not given is infinite: the joint is rigid in that direction."""
    radial, axial, tilting, turning = (
        inf if value is None else value
        for value in (row.radial_n_per_m, row.axial_n_per_m, row.tilting_nm_per_rad, row.turning_nm_per_rad)
    )
    return np.array([radial, radial, axial, tilting, tilting, turning])


def link_of(row: LinkRow) -> Link:
    """A link; one without a tube is rigid."""
    if row.frame is None and any(row.angles_deg):
        raise InputError(f"link {list(row.nodes)}: angles_deg turn a frame; give its name too, frame = ...")
    if row.tube is None and row.elements > 1:
        raise InputError(
            f"link {list(row.nodes)}: elements = {row.elements} of a rigid link; give it a tube, or leave it"
        )
    section = None if row.tube is None else _section(row.tube)
    delta, eta, kappa = (radians(angle) for angle in row.angles_deg)
    return Link(row.nodes, section, row.elements, row.frame, (delta, eta, kappa))


def _section(tube: TubeTable) -> Section:
    if tube.theory not in ("timoshenko", "euler-bernoulli"):
        raise InputError(f"beam theory {tube.theory!r} is none of timoshenko, euler-bernoulli")
    material = Material(tube.young_pa, tube.shear_pa, tube.density_kg_per_m3)
    return hollow_circle(tube.outer_m, tube.inner_m, material, timoshenko=tube.theory == "timoshenko")


def body_of(row: BodyRow) -> LumpedBody:
    """A body whose inertia a rigid body can have."""
    inertia = symmetric(row.inertia_kg_m2)
    fault = inertia_fault(inertia)
    if fault is not None:
        raise InputError(f"body at node {row.node}: inertia_kg_m2 = {list(row.inertia_kg_m2)}: {fault}")
    return LumpedBody(row.node, row.frame, row.mass_kg, np.array(row.centre_m), inertia)


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
    frames = tuple(frame_of(row) for row in content.frames)
    closures = tuple(closure.frames for closure in content.closures)
    spatial = SpatialRobot(
        mechanism=Mechanism(frames, content.robot.tool_frame, closures),
        joints=tuple(joint_of(row, frames) for row in content.joints),
        links=tuple(link_of(row) for row in content.links),
        bodies=tuple(body_of(row) for row in content.bodies),
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


def _check_masses(rows: list[BodyRow]) -> None:
    """A negative mass is what another body of its node has too much; what is left must be one."""
    for number, row in enumerate(rows, start=1):
        left = sum(other.mass_kg for other in rows if other.node == row.node)
        if (row.mass_kg < 0 and left <= -0.5) or row.mass_kg == 0:
            raise InputError(
                f"bodies[{number}].mass_kg must be above 0, not {row.mass_kg!r}; a negative mass stands for what "
                f"another body of node {row.node} has too much, and {left:g} kg are left there"
            )
