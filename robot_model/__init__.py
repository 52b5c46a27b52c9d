"""Robots as data: posture to stiffness, modes, receptance and deviation; knows nothing of recordings."""

from .any_robot import PostureResult, in_posture, named_posture, read_robot
from .dynamic_stiffness.exact_beam import planar_dynamic_stiffness, spatial_dynamic_stiffness
from .dynamic_stiffness.exact_chain import coupled_receptance, exact_receptance
from .dynamic_stiffness.exact_structure import coupled_frf_at, exact_frf_at
from .dynamic_stiffness.receptance_coupling import block_diagonal, couple_along, couple_receptances
from .files.planar_file import PlanarCase, read_planar_robot
from .files.robot_files import assumptions, robot_names
from .files.spatial_file import SpatialCase, read_spatial_robot
from .finite_elements.beam_element import beam_mass, beam_stiffness
from .finite_elements.constrained_statics import constrained_system, tip_compliance, tip_stiffness
from .finite_elements.generalised_coordinates import coordinate_basis
from .finite_elements.gravity import gravity_hessian, gravity_torques, with_gravity
from .finite_elements.modal_damping import modal_damping_matrix, rayleigh_constants
from .finite_elements.modal_reduction import modal_model
from .finite_elements.section import Material, Section, hollow_circle
from .finite_elements.structure import Beam, Body, Spring, Structure, mass_matrix, stiffness_matrix
from .identification.parameter_search import Identification, identify
from .identification.planar_identification import apply_identified, identify_from_frequencies, identify_from_frfs
from .identification.stiffness_identification import (
    Deflection,
    apply_joint_stiffness,
    identify_joint_stiffness,
    predicted_deflections,
    stiffness_names,
)
from .kinematics.damped_least_squares import inverse_kinematics
from .kinematics.joint_values import driven_values, shown_values, typed_values, unit_doubts
from .kinematics.loop_closure import close_loops, posture_warnings, tool_jacobian
from .kinematics.mechanism import Frame, Mechanism
from .kinematics.spherical_wrist import has_spherical_wrist, nearest_solution, wrist_solutions
from .machining.drilling_deviation import (
    DeviationMap,
    deviation_map,
    drilling_wrench,
    joint_deformation,
    joint_deviation,
    sag_parts,
)
from .machining.path_compensation import CompensatedPath, ToolPath, compensate_path
from .machining.path_file import read_tool_path, write_compensated_path
from .machining.redundancy import (
    CutPlace,
    PostureMap,
    frequencies_over,
    posture_map,
    target_of,
    tool_down,
    turned_place,
)
from .machining.uncertainty_budget import (
    LoadUncertainty,
    UncertaintyBudget,
    deformation_uncertainty,
    lateral_uncertainty,
    machining_uncertainty,
    measured_machining_uncertainty,
    monte_carlo_deformation,
    position_tolerance,
    position_verdict,
    tolerance_grade,
)
from .model_updating.causes import Cause, PostureFrequencies, equivalent_causes, explain_frequencies
from .model_updating.change import Change, Companion, Numbered
from .model_updating.changes import changed_robot, possible_changes, unnamed_changes
from .model_updating.variations import (
    with_damping_factor,
    with_joint_factor,
    with_lighter_end,
    with_link_factor,
    with_payload,
    with_rigid_links,
)
from .planar.flexible_links import FlexibleChain, flexible_chain
from .planar.natural_coordinates import NaturalChain
from .planar.planar_robot import PlanarRobot
from .planar.rigid_links import rigid_matrices, rigid_model
from .spatial.cell_structure import cell_structure_at
from .spatial.compliant_tool import housing_node, tool_spring, with_tool_spring
from .spatial.natural_coordinates import NaturalRobot, natural_robot
from .spatial.spatial_modes import StructureModes, damping_warnings, frf_at, modal_model_at, model_of_modes, modes_at
from .spatial.spatial_robot import ElasticJoint, Link, LumpedBody, SpatialRobot, drive_stiffness, structure_at
from .spatial.weight import Payload, StaticResponse, counted_weight, payload_wrench, sag_at, static_response

__all__ = [
    "Beam",
    "Body",
    "Cause",
    "Change",
    "Companion",
    "CompensatedPath",
    "CutPlace",
    "Deflection",
    "DeviationMap",
    "ElasticJoint",
    "FlexibleChain",
    "Frame",
    "Identification",
    "Link",
    "LoadUncertainty",
    "LumpedBody",
    "Material",
    "Mechanism",
    "NaturalChain",
    "NaturalRobot",
    "Numbered",
    "Payload",
    "PlanarCase",
    "PlanarRobot",
    "PostureFrequencies",
    "PostureMap",
    "PostureResult",
    "Section",
    "SpatialCase",
    "SpatialRobot",
    "Spring",
    "StaticResponse",
    "Structure",
    "StructureModes",
    "ToolPath",
    "UncertaintyBudget",
    "apply_identified",
    "apply_joint_stiffness",
    "assumptions",
    "beam_mass",
    "beam_stiffness",
    "block_diagonal",
    "cell_structure_at",
    "changed_robot",
    "close_loops",
    "compensate_path",
    "constrained_system",
    "coordinate_basis",
    "counted_weight",
    "couple_along",
    "couple_receptances",
    "coupled_frf_at",
    "coupled_receptance",
    "damping_warnings",
    "deformation_uncertainty",
    "deviation_map",
    "drilling_wrench",
    "drive_stiffness",
    "driven_values",
    "equivalent_causes",
    "exact_frf_at",
    "exact_receptance",
    "explain_frequencies",
    "flexible_chain",
    "frequencies_over",
    "frf_at",
    "gravity_hessian",
    "gravity_torques",
    "has_spherical_wrist",
    "hollow_circle",
    "housing_node",
    "identify",
    "identify_from_frequencies",
    "identify_from_frfs",
    "identify_joint_stiffness",
    "in_posture",
    "inverse_kinematics",
    "joint_deformation",
    "joint_deviation",
    "lateral_uncertainty",
    "machining_uncertainty",
    "mass_matrix",
    "measured_machining_uncertainty",
    "modal_damping_matrix",
    "modal_model",
    "modal_model_at",
    "model_of_modes",
    "modes_at",
    "monte_carlo_deformation",
    "named_posture",
    "natural_robot",
    "nearest_solution",
    "payload_wrench",
    "planar_dynamic_stiffness",
    "position_tolerance",
    "position_verdict",
    "possible_changes",
    "posture_map",
    "posture_warnings",
    "predicted_deflections",
    "rayleigh_constants",
    "read_planar_robot",
    "read_robot",
    "read_spatial_robot",
    "read_tool_path",
    "rigid_matrices",
    "rigid_model",
    "robot_names",
    "sag_at",
    "sag_parts",
    "shown_values",
    "spatial_dynamic_stiffness",
    "static_response",
    "stiffness_matrix",
    "stiffness_names",
    "structure_at",
    "target_of",
    "tip_compliance",
    "tip_stiffness",
    "tolerance_grade",
    "tool_down",
    "tool_jacobian",
    "tool_spring",
    "turned_place",
    "typed_values",
    "unit_doubts",
    "unnamed_changes",
    "with_damping_factor",
    "with_gravity",
    "with_joint_factor",
    "with_lighter_end",
    "with_link_factor",
    "with_payload",
    "with_rigid_links",
    "with_tool_spring",
    "wrist_solutions",
    "write_compensated_path",
]
