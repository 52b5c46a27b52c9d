from .joint_law import JointLaw, JointMotion
from .joint_simulation import JointResponse, common_axes, driven_force, joint_dynamics, joint_response, stiffness_ramp
from .saturation import Saturation, rounded, saturated
from .tangent_loop import tangent_run

__all__ = [
    "JointLaw",
    "JointMotion",
    "JointResponse",
    "Saturation",
    "common_axes",
    "driven_force",
    "joint_dynamics",
    "joint_response",
    "rounded",
    "saturated",
    "stiffness_ramp",
    "tangent_run",
]
