from .along_path import Loading, PathCut, PathOptimum, Wanted, draw_path, optimised
from .commands import robot_app
from .depth_maps import certified_over_places, depth_over_places, depth_over_redundancy, first_postures
from .diagnosis import UNITS, refusal, told_number, what_is_asked
from .posture_figure import draw_posture_map

__all__ = [
    "UNITS",
    "Loading",
    "PathCut",
    "PathOptimum",
    "Wanted",
    "certified_over_places",
    "depth_over_places",
    "depth_over_redundancy",
    "draw_path",
    "draw_posture_map",
    "first_postures",
    "optimised",
    "refusal",
    "robot_app",
    "told_number",
    "what_is_asked",
]
