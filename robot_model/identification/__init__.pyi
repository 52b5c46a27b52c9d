from .elastic_parameters import ElasticParameter, JointStiffness, LinkSection, joint_parameters, link_parameters
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
    "Identification",
    "JointStiffness",
    "LinkSection",
    "apply_elastic",
    "apply_identified",
    "apply_joint_stiffness",
    "identify",
    "identify_elastic",
    "identify_from_frequencies",
    "identify_from_frfs",
    "identify_joint_stiffness",
    "joint_parameters",
    "link_parameters",
    "predicted_deflections",
    "stiffness_names",
]
