from .cell_structure import cell_structure_at
from .compliant_tool import TOOL_MASS, housing_node, tool_spring, with_tool_spring
from .joint_drive import JointDrive
from .natural_coordinates import NaturalRobot, natural_robot
from .spatial_modes import (
    TIP_ROTATIONS,
    StructureModes,
    damping_of_modes,
    damping_warnings,
    frf_at,
    modal_damping,
    modal_model_at,
    model_of_modes,
    modes_at,
)
from .spatial_robot import ElasticJoint, Link, LumpedBody, SpatialRobot, drive_stiffness, rigid_arms, structure_at
from .tip_check import check_tip
from .weight import (
    NO_MASSES,
    Payload,
    StaticResponse,
    acceleration,
    counted_weight,
    payload_wrench,
    sag_at,
    static_response,
    tool_attitude,
)

__all__ = [
    "NO_MASSES",
    "TIP_ROTATIONS",
    "TOOL_MASS",
    "ElasticJoint",
    "JointDrive",
    "Link",
    "LumpedBody",
    "NaturalRobot",
    "Payload",
    "SpatialRobot",
    "StaticResponse",
    "StructureModes",
    "acceleration",
    "cell_structure_at",
    "check_tip",
    "counted_weight",
    "damping_of_modes",
    "damping_warnings",
    "drive_stiffness",
    "frf_at",
    "housing_node",
    "modal_damping",
    "modal_model_at",
    "model_of_modes",
    "modes_at",
    "natural_robot",
    "payload_wrench",
    "rigid_arms",
    "sag_at",
    "static_response",
    "structure_at",
    "tool_attitude",
    "tool_spring",
    "with_tool_spring",
]
