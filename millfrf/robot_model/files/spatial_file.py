"""Robots in space with frames and nodes of their own, from their files."""

import os
from math import radians

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from millfrf.core import InputError

from ..finite_elements.beam_element import Material, Section, hollow_circle
from ..kinematics.mechanism import Frame, Mechanism
from ..spatial.spatial_robot import ElasticJoint, JointDrive, Link, LumpedBody, SpatialRobot
from .common_tables import (
    BearingKeys,
    DampingTable,
    InertiaKeys,
    LimitKeys,
    PoseRow,
    SpatialCase,
    UpdateTable,
    Vector,
    damping_and_gravity,
    spatial_case,
)
from .robot_files import SpatialHeadTable, Table, read_as


class NodesHeadTable(SpatialHeadTable):
    """The table ``[robot]``.

    Parameters
    ----------
    tip_node
        Node of the tool's tip; it stands at the origin of ``tool_frame``.
    tool_frame
        Frame of the tool, z along it.
    """

    tip_node: int
    tool_frame: str


class FrameRow(LimitKeys):
    """A row ``[[frames]]``: turn about z, shift along z, turn about x, shift along x, turn and shift along the new z.

    The parameters are those of Khalil and Kleinfinger.

    Parameters
    ----------
    name
        Name of the frame.
    antecedent
        Frame before it; ``0`` is the base.
    motion
        ``revolute``, ``prismatic`` or ``fixed``.
    active
        Whether the joint is driven; false: it follows from a closed loop.
    gamma_deg : deg
        First turn, about z of the frame before.
    b_m : m
        First shift, along that z.
    alpha_deg : deg
        Turn about x.
    d_m : m
        Shift along x.
    theta_deg : deg
        Last turn, about the frame's own z; of a revolute joint its zero, to which the joint's angle is added.
    r_m : m
        Last shift, along the frame's own z; of a prismatic joint its zero.
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

    def frame(self) -> Frame:
        """Return the frame, with angles in rad."""
        lower, upper = self.limits(f"frame {self.name}", self.motion)
        return Frame(
            self.name,
            self.antecedent,
            self.motion,
            self.active,
            radians(self.gamma_deg),
            self.b_m,
            radians(self.alpha_deg),
            self.d_m,
            radians(self.theta_deg),
            self.r_m,
            lower,
            upper,
        )


class JointRow(BearingKeys):
    """A row ``[[joints]]``: springs and dampers between two nodes, in the axes of a frame.

    A motor has its inertia, its gear ratio and one gain, or none of these keys.

    Parameters
    ----------
    frame
        Frame whose z is the axis of the joint.
    nodes
        Node before and node after the joint.
    damping_nms_per_rad : N m s/rad
        Viscous damping about the axis of a revolute joint.
    damping_ns_per_m : N s/m
        Viscous damping along the axis of a prismatic joint.
    motor_inertia_kg_m2 : kg m^2
        Inertia of the parts that turn with the motor.
    gear_ratio
        Turns of the motor over those of the joint; rad/m for a prismatic joint.
    position_gain_nm_per_rad : N m/rad
        Static stiffness with which the controller holds the motor of a revolute joint, on the side of the joint.
    position_gain_n_per_m : N/m
        The same for a prismatic joint.
    """

    frame: str
    nodes: tuple[int, int]
    damping_nms_per_rad: float = 0.0
    damping_ns_per_m: float = 0.0
    motor_inertia_kg_m2: float | None = Field(None, gt=0, le=1)
    gear_ratio: float | None = Field(None, ge=1)
    position_gain_nm_per_rad: float | None = Field(None, gt=0)
    position_gain_n_per_m: float | None = Field(None, gt=0)

    def joint(self, frames: tuple[Frame, ...]) -> ElasticJoint:
        """Return the elastic joint; the damping must be given in the unit of the joint's motion."""
        frame = next((frame for frame in frames if frame.name == self.frame), None)
        slides = frame is not None and frame.motion == "prismatic"
        keys = ("damping_ns_per_m", "damping_nms_per_rad") if slides else ("damping_nms_per_rad", "damping_ns_per_m")
        damping, wrong_unit = (getattr(self, key) for key in keys)
        if wrong_unit:
            raise InputError(
                f"joint {self.frame}: {keys[1]} = {wrong_unit:g} has not the unit of its motion; give {keys[0]}"
            )
        # a frame that does not exist is refused when the robot is built
        drive = None if frame is None else self._drive(frame)
        return ElasticJoint(self.frame, self.nodes, self.stiffness(), drive, damping)

    def _drive(self, frame: Frame) -> JointDrive | None:
        gains = {"revolute": self.position_gain_nm_per_rad, "prismatic": self.position_gain_n_per_m}
        keys = {"revolute": "position_gain_nm_per_rad", "prismatic": "position_gain_n_per_m"}
        if all(value is None for value in (self.motor_inertia_kg_m2, self.gear_ratio, *gains.values())):
            return None
        if frame.motion == "fixed" or not frame.active:
            raise InputError(
                f"joint {frame.name} is not driven: leave motor_inertia_kg_m2, gear_ratio and its gain out"
            )
        gain = gains.pop(frame.motion)
        if self.motor_inertia_kg_m2 is None or self.gear_ratio is None or gain is None or any(gains.values()):
            raise InputError(
                f"joint {frame.name}: a drive is motor_inertia_kg_m2, gear_ratio and, for a {frame.motion} joint, "
                f"{keys[frame.motion]}: give these three, or none (without them the motor stands still)"
            )
        return JointDrive(self.motor_inertia_kg_m2, self.gear_ratio, gain)


class TubeTable(Table):
    """The table ``[links.tube]``: a round hollow beam.

    Parameters
    ----------
    outer_m : m
        Outer diameter of the tube.
    inner_m : m
        Inner diameter of the tube, below the outer one.
    young_pa : Pa
        Young's modulus of the material.
    shear_pa : Pa
        Shear modulus of the material.
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

    def section(self) -> Section:
        """Section of the beam."""
        if self.theory not in ("timoshenko", "euler-bernoulli"):
            raise InputError(f"beam theory {self.theory!r} is none of timoshenko, euler-bernoulli")
        material = Material(self.young_pa, self.shear_pa, self.density_kg_per_m3)
        return hollow_circle(self.outer_m, self.inner_m, material, timoshenko=self.theory == "timoshenko")


class LinkRow(Table):
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
        Turns about x, then the turned y, then the turned z; x then lies along the link.
    """

    nodes: tuple[int, int]
    tube: TubeTable | None = None
    elements: int = Field(1, ge=1)
    frame: str | None = None
    angles_deg: Vector = (0.0, 0.0, 0.0)

    def link(self) -> Link:
        """The link, which is rigid without a tube."""
        if self.frame is None and any(self.angles_deg):
            raise InputError(f"link {list(self.nodes)}: angles_deg turn a frame; give its name too, frame = ...")
        if self.tube is None and self.elements > 1:
            raise InputError(
                f"link {list(self.nodes)}: elements = {self.elements} of a rigid link; give it a tube, or leave it"
            )
        section = None if self.tube is None else self.tube.section()
        delta, eta, kappa = (radians(angle) for angle in self.angles_deg)
        return Link(self.nodes, section, self.elements, self.frame, (delta, eta, kappa))


class PointRow(Table):
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
    at_m: Vector


class BodyRow(InertiaKeys):
    """A row ``[[bodies]]``: a rigid body at a node.

    Parameters
    ----------
    node
        Node that carries it.
    frame
        Frame in whose axes centre and inertia are given.
    mass_kg : kg
        Mass of the body, not 0; a negative mass corrects another body of the same node that has too much.
    """

    node: int
    frame: str
    mass_kg: float

    def body(self) -> LumpedBody:
        """The lumped body at its node."""
        inertia = self.inertia(f"body at node {self.node}")
        return LumpedBody(self.node, self.frame, self.mass_kg, np.array(self.centre_m), inertia)


class ClosureRow(Table):
    """A row ``[[closures]]``: where a loop was cut.

    Parameters
    ----------
    frames
        Two frames that coincide.
    """

    frames: tuple[str, str]


class SpatialFile(BaseModel):
    """A robot file of kind ``spatial``.

    Parameters
    ----------
    robot
        Name and kind of the robot, its tip, gravity and repeatability.
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
        Rigid bodies at nodes; a robot without any mass, of bodies or tubes, has statics only.
    damping
        Damping of the structure.
    poses
        Named postures; the first is the default.
    update
        Result of ``millfrf robot update``: the changed numbers and their covariance; written by it.
    """

    model_config = ConfigDict(extra="forbid")

    robot: NodesHeadTable
    frames: list[FrameRow]
    closures: list[ClosureRow] = []
    joints: list[JointRow]
    links: list[LinkRow] = []
    points: list[PointRow] = []
    bodies: list[BodyRow] = []
    damping: DampingTable | None = None
    poses: list[PoseRow] = []
    update: UpdateTable | None = None


def read_spatial_robot(robot: str | os.PathLike[str]) -> SpatialCase:
    """Read a robot of kind ``spatial``, by path or by name.

    Raises
    ------
    InputError
        No such robot, or frames and nodes that do not fit together.
    FileFormatError
        Not a robot in space, or a key unknown, missing or of the wrong type.
    """
    return read_as(SpatialFile, robot, "spatial", _case)


def _case(content: SpatialFile) -> SpatialCase:
    nodes = [row.node for row in content.points]
    for node in nodes:
        if nodes.count(node) > 1:
            raise InputError(f"[[points]] place node {node} twice; place it once")
    frames = tuple(row.frame() for row in content.frames)
    closures = tuple(closure.frames for closure in content.closures)
    robot = SpatialRobot(
        mechanism=Mechanism(frames, content.robot.tool_frame, closures),
        joints=tuple(row.joint(frames) for row in content.joints),
        links=tuple(row.link() for row in content.links),
        bodies=tuple(row.body() for row in content.bodies),
        points={row.node: (row.frame, np.array(row.at_m)) for row in content.points},
        tip=content.robot.tip_node,
        **damping_and_gravity(content.robot, content.damping),
    )
    _check_masses(content.bodies)
    warnings = () if content.update is None else content.update.warnings()
    return spatial_case(content.robot, robot, content.poses, content.update, warnings)


def _check_masses(rows: list[BodyRow]) -> None:
    """Check that the masses of a node do not add up to a negative mass (below -0.5 kg, because of rounding)."""
    for number, row in enumerate(rows, start=1):
        total = sum(other.mass_kg for other in rows if other.node == row.node)
        if (row.mass_kg < 0 and total <= -0.5) or row.mass_kg == 0:
            raise InputError(
                f"bodies[{number}].mass_kg must be above 0, not {row.mass_kg!r}; a negative mass corrects another body "
                f"of node {row.node} that has too much, but the masses of that node add up to {total:g} kg"
            )
