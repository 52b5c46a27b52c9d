from .changed_structure import (
    LEAST_COMPLIANCE,
    carrier_node,
    changed_by,
    damping_unit,
    on_springs,
    payload_centre,
    place_of_node,
    point_mass,
    tool_node,
)
from .matrices import PostureSystem, posture_system
from .posture_response import Answer, answer, receptance_of
from .update_parameter import FOUNDATION, GROUPS, UpdateParameter, free_parameters, unnamed_parameters

__all__ = [
    "FOUNDATION",
    "GROUPS",
    "LEAST_COMPLIANCE",
    "Answer",
    "PostureSystem",
    "UpdateParameter",
    "answer",
    "carrier_node",
    "changed_by",
    "damping_unit",
    "free_parameters",
    "on_springs",
    "payload_centre",
    "place_of_node",
    "point_mass",
    "posture_system",
    "receptance_of",
    "tool_node",
    "unnamed_parameters",
]
