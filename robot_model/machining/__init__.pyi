from .drilling_deviation import (
    DeviationMap,
    deviation_map,
    drilling_wrench,
    joint_deformation,
    joint_deviation,
    sag_parts,
)
from .path_compensation import CompensatedPath, ToolPath, compensate_path
from .path_file import MOMENTS, read_tool_path, write_compensated_path
from .redundancy import CutPlace, PostureMap, frequencies_over, posture_map, target_of, tool_down, turned_place
from .runout_deviation import ProcessDeviation, orbit_radius, process_deviation
from .uncertainty_budget import (
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

__all__ = [
    "MOMENTS",
    "CompensatedPath",
    "CutPlace",
    "DeviationMap",
    "LoadUncertainty",
    "PostureMap",
    "ProcessDeviation",
    "ToolPath",
    "UncertaintyBudget",
    "compensate_path",
    "deformation_uncertainty",
    "deviation_map",
    "drilling_wrench",
    "frequencies_over",
    "joint_deformation",
    "joint_deviation",
    "lateral_uncertainty",
    "machining_uncertainty",
    "measured_machining_uncertainty",
    "monte_carlo_deformation",
    "orbit_radius",
    "position_tolerance",
    "position_verdict",
    "posture_map",
    "process_deviation",
    "read_tool_path",
    "sag_parts",
    "target_of",
    "tolerance_grade",
    "tool_down",
    "turned_place",
    "write_compensated_path",
]
