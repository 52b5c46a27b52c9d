from .parameter_search import Identification, identify
from .planar_identification import apply_identified, identify_from_frequencies, identify_from_frfs
from .stiffness_identification import (
    Deflection,
    apply_joint_stiffness,
    identify_joint_stiffness,
    predicted_deflections,
    stiffness_names,
)

__all__ = [
    "Deflection",
    "Identification",
    "apply_identified",
    "apply_joint_stiffness",
    "identify",
    "identify_from_frequencies",
    "identify_from_frfs",
    "identify_joint_stiffness",
    "predicted_deflections",
    "stiffness_names",
]
