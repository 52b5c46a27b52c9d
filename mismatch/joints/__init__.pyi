from .axis_file import axis_location, axis_of
from .filters_of_modes import ModalFilters, modal_filters
from .joint_axis import JointAxis, ModalScales, tip_axes
from .joint_law import JointLaw, JointMotion
from .joint_paths import JointPath, JointReach, combined_model, joint_reach
from .joint_simulation import JointResponse, driven_force, joint_dynamics, joint_response, stiffness_ramp
from .joint_words import joint_in_words
from .loops import law_change_run, tangent_run
from .reciprocity import inside_of, modal_scales
from .saturation import Saturation, rounded, saturated
from .slopes_of_law import LawSlopes, law_quotient, law_slopes

__all__ = [
    "JointAxis",
    "JointLaw",
    "JointMotion",
    "JointPath",
    "JointReach",
    "JointResponse",
    "LawSlopes",
    "ModalFilters",
    "ModalScales",
    "Saturation",
    "axis_location",
    "axis_of",
    "combined_model",
    "driven_force",
    "inside_of",
    "joint_dynamics",
    "joint_in_words",
    "joint_reach",
    "joint_response",
    "law_change_run",
    "law_quotient",
    "law_slopes",
    "modal_filters",
    "modal_scales",
    "rounded",
    "saturated",
    "stiffness_ramp",
    "tangent_run",
    "tip_axes",
]
