from .along_path import Loading, PathCut, PathOptimum, Wanted, draw_path, optimised
from .commands import robot_app
from .depth_maps import certified_over_places, depth_over_places, depth_over_redundancy, first_postures
from .diagnosis import UNITS, Asking, diagnose_robot_files, refusal, told_number, what_is_asked
from .learned import LearningFrom, driven_of, learn_from_files
from .posture_figure import draw_posture_map

__all__ = [
    "UNITS",
    "Asking",
    "LearningFrom",
    "Loading",
    "PathCut",
    "PathOptimum",
    "Wanted",
    "certified_over_places",
    "depth_over_places",
    "depth_over_redundancy",
    "diagnose_robot_files",
    "draw_path",
    "draw_posture_map",
    "driven_of",
    "first_postures",
    "learn_from_files",
    "optimised",
    "refusal",
    "robot_app",
    "told_number",
    "what_is_asked",
]
