"""`SpatialFile`: the tables of a robot in space."""

from pydantic import BaseModel, ConfigDict, Field

from .common_tables import Damping, DriveKeys, Pose, UpdateTable
from .robot_files import Table


class HeadTable(Table):
    """The table ``[robot]``.

    Parameters
    ----------
    name
        Name of the robot.
    kind
        ``serial``, ``spatial`` or ``planar``: which tables the file has.
    gravity_m_per_s2 : m/s^2
        Gravity as a stiffness of the structure, for open chains only; 0: left out.
    up
        Axis of the base against the weight: ``[0, 0, 1]`` stands on the floor, ``[0, 0, -1]`` hangs from a ceiling.
    repeatability_m : m
        Pose repeatability after ISO 9283 (RP), such as 6e-5 for 0.06 mm.
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
    repeatability_m: float | None = Field(None, ge=1e-6, le=5e-3)


class FrameRow(Table):
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
    limits_deg : deg
        Least and largest angle of a revolute joint; left out: none.
    limits_m : m
        Least and largest travel of a prismatic joint; left out: none.
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


class JointRow(DriveKeys):
    """A row ``[[joints]]``: springs and dampers between two nodes, in the axes of a frame.

    Parameters
    ----------
    frame
        Frame whose z is the axis of the joint.
    nodes
        Node before and node after the joint.
    radial_n_per_m : N/m
        Stiffness of the bearing across the joint's axis; left out: rigid.
    axial_n_per_m : N/m
        Stiffness of the bearing along the joint's axis; left out: rigid.
    tilting_nm_per_rad : N m/rad
        Stiffness of the bearing against tilting of the axis; left out: rigid.
    turning_nm_per_rad : N m/rad
        Stiffness about the axis: the gear of a revolute joint; left out: rigid.
    damping_nms_per_rad : N m s/rad
        Viscous damping about the axis of a revolute joint.
    damping_ns_per_m : N s/m
        Viscous damping along the axis of a prismatic joint.
    """

    frame: str
    nodes: tuple[int, int]
    radial_n_per_m: float | None = Field(None, gt=0)
    axial_n_per_m: float | None = Field(None, gt=0)
    tilting_nm_per_rad: float | None = Field(None, gt=0)
    turning_nm_per_rad: float | None = Field(None, gt=0)
    damping_nms_per_rad: float = 0.0
    damping_ns_per_m: float = 0.0


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
    angles_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)


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
    at_m: tuple[float, float, float]


class BodyRow(Table):
    """A row ``[[bodies]]``: a rigid body at a node.

    Parameters
    ----------
    node
        Node that carries it.
    frame
        Frame in whose axes centre and inertia are told.
    mass_kg : kg
        Mass of the body, not 0; below 0 where another body of its node has that much too much.
    centre_m : m
        Centre of mass from the node.
    inertia_kg_m2 : kg m^2
        Inertia about the centre of mass: ``xx yy zz``, or ``xx yy zz xy xz yz`` with the signs of the matrix's entries.
    """

    node: int
    frame: str
    mass_kg: float
    centre_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia_kg_m2: tuple[float, float, float] | tuple[float, float, float, float, float, float] = (0.0, 0.0, 0.0)


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
        Rigid bodies at nodes; a robot without any mass, of bodies or tubes, has statics only.
    damping
        Damping of the structure.
    poses
        Named postures; the first is the default.
    update
        What ``millfrf robot update`` changed and left open; written by it.
    """

    model_config = ConfigDict(extra="forbid")

    robot: HeadTable
    frames: list[FrameRow]
    closures: list[ClosureRow] = []
    joints: list[JointRow]
    links: list[LinkRow] = []
    points: list[PointRow] = []
    bodies: list[BodyRow] = []
    damping: Damping | None = None
    poses: list[Pose] = []
    update: UpdateTable | None = None
