from .any_robot import PostureResult, in_posture, named_posture, read_robot
from .dynamic_stiffness import exact_receptance
from .files.file_changes import changed_robot_text, numbered_robot_text
from .files.planar_file import PlanarCase, PlanarFile, read_planar_robot
from .files.robot_files import assumptions, robot_names
from .files.serial_file import SerialFile
from .files.spatial_file import SpatialCase, read_spatial_robot
from .files.spatial_tables import SpatialFile
from .finite_elements.beam_element import tube_diameters
from .finite_elements.statics import STANDARD_GRAVITY, gravity_torques, tip_compliance
from .full_update.changed_structure import UpdateParameter
from .full_update.posed_receptance import PosedReceptance, measured_frf, measured_model
from .full_update.update import RobotUpdate, update_robot
from .identification.elastic_parameters import (
    ElasticParameter,
    JointStiffness,
    LinkSection,
    joint_parameters,
    link_parameters,
)
from .identification.parameter_search import Identification, identify
from .identification.planar_identification import apply_identified, identify_from_frequencies
from .identification.stiffness_identification import (
    Deflection,
    HeldOut,
    apply_elastic,
    apply_joint_stiffness,
    identify_elastic,
    identify_joint_stiffness,
    predicted_deflections,
    read_deflections,
    stiffness_names,
    verify_elastic,
)
from .kinematics.inverse import inverse_kinematics, reach, tool_postures
from .kinematics.joint_values import driven_values, shown_values, typed_values, unit_doubts
from .kinematics.mechanism import Frame, Mechanism, close_loops, rotation_vector, tool_jacobian
from .kinematics.spherical_wrist import has_spherical_wrist, nearest_solution, wrist_solutions
from .machining.drilling_deviation import (
    DeviationMap,
    ProcessDeviation,
    deviation_map,
    drilling_wrench,
    orbit_radius,
    process_deviation,
    sag_parts,
)
from .machining.path_compensation import (
    CompensatedPath,
    ToolPath,
    compensate_path,
    read_tool_path,
    write_compensated_path,
)
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
    measured_machining_uncertainty,
    monte_carlo_deformation,
    position_tolerance,
    position_verdict,
)
from .model_updating.changes import Change, Companion, Numbered, with_joint_factor, with_payload
from .model_updating.weighed_changes import changed_robot, possible_changes, unnamed_changes
from .planar import PlanarRobot, rigid_matrices, rigid_model
from .posture_process.learned_file import read_learned_postures, write_learned_postures
from .posture_process.learning import LearnedPostures, learn_postures
from .posture_process.measured_modes import measured_modes
from .posture_process.next_postures import LeftOutPosture, choose_postures, left_out_postures
from .posture_process.predicting import PredictedPosture, predict_posture
from .serial_chains.chain_file import Told, chain_text, class_of, ready_posture, spatial_robot, typical
from .serial_chains.dh_chain import read_dh
from .serial_chains.serial_chain import BASE, RigidPart, SerialChain, place_of
from .serial_chains.urdf import ReadChain, read_urdf
from .spatial.spatial_modes import (
    StructureModes,
    cell_structure_at,
    damping_of_modes,
    housing_node,
    modal_model_at,
    model_of_modes,
    modes_at,
    with_tool_spring,
)
from .spatial.spatial_robot import SpatialRobot, drive_stiffness, structure_at
from .spatial.weight import NO_MASSES, Payload, counted_weight, payload_wrench, tool_attitude
from .tool_paths.cut_path import CutPath, RotaryTable, attitudes_along, cut_path, read_cut_path
from .tool_paths.posture_sequence import (
    PointPostures,
    PostureSequence,
    Redundancy,
    best_sequence,
    limit_margin,
    path_postures,
    point_postures,
    reached_near,
    singular_values,
    tool_deflection,
)
from .uncertain_robot.bands import derived_errors, frf_with_errors
from .uncertain_robot.document import updated_document

__all__ = [
    "BASE",
    "NO_MASSES",
    "STANDARD_GRAVITY",
    "Change",
    "Companion",
    "CompensatedPath",
    "CutPath",
    "CutPlace",
    "Deflection",
    "DeviationMap",
    "ElasticParameter",
    "Frame",
    "HeldOut",
    "Identification",
    "JointStiffness",
    "LearnedPostures",
    "LeftOutPosture",
    "LinkSection",
    "LoadUncertainty",
    "Mechanism",
    "Numbered",
    "Payload",
    "PlanarCase",
    "PlanarFile",
    "PlanarRobot",
    "PointPostures",
    "PosedReceptance",
    "PostureMap",
    "PostureResult",
    "PostureSequence",
    "PredictedPosture",
    "ProcessDeviation",
    "ReadChain",
    "Redundancy",
    "RigidPart",
    "RobotUpdate",
    "RotaryTable",
    "SerialChain",
    "SerialFile",
    "SpatialCase",
    "SpatialFile",
    "SpatialRobot",
    "StructureModes",
    "Told",
    "ToolPath",
    "UncertaintyBudget",
    "UpdateParameter",
    "apply_elastic",
    "apply_identified",
    "apply_joint_stiffness",
    "assumptions",
    "attitudes_along",
    "best_sequence",
    "cell_structure_at",
    "chain_text",
    "changed_robot",
    "changed_robot_text",
    "choose_postures",
    "class_of",
    "close_loops",
    "compensate_path",
    "counted_weight",
    "cut_path",
    "damping_of_modes",
    "deformation_uncertainty",
    "derived_errors",
    "deviation_map",
    "drilling_wrench",
    "drive_stiffness",
    "driven_values",
    "exact_receptance",
    "frequencies_over",
    "frf_with_errors",
    "gravity_torques",
    "has_spherical_wrist",
    "housing_node",
    "identify",
    "identify_elastic",
    "identify_from_frequencies",
    "identify_joint_stiffness",
    "in_posture",
    "inverse_kinematics",
    "joint_parameters",
    "lateral_uncertainty",
    "learn_postures",
    "left_out_postures",
    "limit_margin",
    "link_parameters",
    "measured_frf",
    "measured_machining_uncertainty",
    "measured_model",
    "measured_modes",
    "modal_model_at",
    "model_of_modes",
    "modes_at",
    "monte_carlo_deformation",
    "named_posture",
    "nearest_solution",
    "numbered_robot_text",
    "orbit_radius",
    "path_postures",
    "payload_wrench",
    "place_of",
    "point_postures",
    "position_tolerance",
    "position_verdict",
    "possible_changes",
    "posture_map",
    "predict_posture",
    "predicted_deflections",
    "process_deviation",
    "reach",
    "reached_near",
    "read_cut_path",
    "read_deflections",
    "read_dh",
    "read_learned_postures",
    "read_planar_robot",
    "read_robot",
    "read_spatial_robot",
    "read_tool_path",
    "read_urdf",
    "ready_posture",
    "rigid_matrices",
    "rigid_model",
    "robot_names",
    "rotation_vector",
    "sag_parts",
    "shown_values",
    "singular_values",
    "spatial_robot",
    "stiffness_names",
    "structure_at",
    "target_of",
    "tip_compliance",
    "tool_attitude",
    "tool_deflection",
    "tool_down",
    "tool_jacobian",
    "tool_postures",
    "tube_diameters",
    "turned_place",
    "typed_values",
    "typical",
    "unit_doubts",
    "unnamed_changes",
    "update_robot",
    "updated_document",
    "verify_elastic",
    "with_joint_factor",
    "with_payload",
    "with_tool_spring",
    "wrist_solutions",
    "write_compensated_path",
    "write_learned_postures",
]
