from .branches import (
    tool_postures,
)
from .damped_least_squares import (
    inverse_kinematics,
)
from .joint_values import (
    LARGEST_TRAVEL,
    driven_values,
    joint_unit,
    named_values,
    shown_values,
    typed_values,
    unit_doubts,
)
from .loop_closure import (
    close_loops,
    posture_warnings,
    tool_jacobian,
)
from .mechanism import (
    Frame,
    Mechanism,
    drive_direction,
    rotation_vector,
)
from .reaching import (
    all_postures,
    nearest_approach,
    reach,
)
from .spherical_wrist import (
    has_spherical_wrist,
    nearest_solution,
    wrist_solutions,
)

__all__ = [
    "LARGEST_TRAVEL",
    "Frame",
    "Mechanism",
    "all_postures",
    "close_loops",
    "drive_direction",
    "driven_values",
    "has_spherical_wrist",
    "inverse_kinematics",
    "joint_unit",
    "named_values",
    "nearest_approach",
    "nearest_solution",
    "posture_warnings",
    "reach",
    "rotation_vector",
    "shown_values",
    "tool_jacobian",
    "tool_postures",
    "typed_values",
    "unit_doubts",
    "wrist_solutions",
]
