from .deflection_file import deflection_columns, read_deflections
from .elastic_parameters import ElasticParameter, JointStiffness, LinkSection, joint_parameters, link_parameters
from .held_out import HeldOut, verify_elastic
from .parameter_search import Identification, identify
from .planar_identification import apply_identified, identify_from_frequencies, identify_from_frfs
from .stiffness_identification import (
    Deflection,
    apply_elastic,
    apply_joint_stiffness,
    identify_elastic,
    identify_joint_stiffness,
    predicted_deflections,
    stiffness_names,
)

__all__ = [
    "Deflection",
    "ElasticParameter",
    "HeldOut",
    "Identification",
    "JointStiffness",
    "LinkSection",
    "apply_elastic",
    "apply_identified",
    "apply_joint_stiffness",
    "deflection_columns",
    "identify",
    "identify_elastic",
    "identify_from_frequencies",
    "identify_from_frfs",
    "identify_joint_stiffness",
    "joint_parameters",
    "link_parameters",
    "predicted_deflections",
    "read_deflections",
    "stiffness_names",
    "verify_elastic",
]
