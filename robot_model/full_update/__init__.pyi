from .belief import Belief
from .held_out import LeftOut
from .next_posture import NextPosture
from .posed_receptance import PosedReceptance, measured_frf, measured_model
from .response import (
    FOUNDATION,
    GROUPS,
    LEAST_COMPLIANCE,
    UpdateParameter,
    carrier_node,
    changed_by,
    damping_unit,
    free_parameters,
    on_springs,
    payload_centre,
    place_of_node,
    point_mass,
    tool_node,
    unnamed_parameters,
)
from .told_apart import OpenDirection, open_directions
from .update import RobotUpdate, update_robot

__all__ = [
    "FOUNDATION",
    "GROUPS",
    "LEAST_COMPLIANCE",
    "Belief",
    "LeftOut",
    "NextPosture",
    "OpenDirection",
    "PosedReceptance",
    "RobotUpdate",
    "UpdateParameter",
    "carrier_node",
    "changed_by",
    "damping_unit",
    "free_parameters",
    "measured_frf",
    "measured_model",
    "on_springs",
    "open_directions",
    "payload_centre",
    "place_of_node",
    "point_mass",
    "tool_node",
    "unnamed_parameters",
    "update_robot",
]
