from .cut_path_file import read_cut_path
from .joint_margins import limit_margin, singular_values
from .places_of_cut import CutPath, attitudes_along, cut_path
from .posture_sequence import PostureSequence, best_sequence
from .redundant_postures import (
    PointPostures,
    Redundancy,
    of_point,
    path_postures,
    point_postures,
    reached_near,
    with_turns,
)
from .rotary_table import RotaryTable
from .static_deflection import tool_deflection

__all__ = [
    "CutPath",
    "PointPostures",
    "PostureSequence",
    "Redundancy",
    "RotaryTable",
    "attitudes_along",
    "best_sequence",
    "cut_path",
    "limit_margin",
    "of_point",
    "path_postures",
    "point_postures",
    "reached_near",
    "read_cut_path",
    "singular_values",
    "tool_deflection",
    "with_turns",
]
