from .commands import robot_app
from .depth_maps import depth_over_places, depth_over_redundancy
from .diagnosis import UNITS, refusal, told_number, what_is_asked
from .posture_figure import draw_posture_map

__all__ = [
    "UNITS",
    "depth_over_places",
    "depth_over_redundancy",
    "draw_posture_map",
    "refusal",
    "robot_app",
    "told_number",
    "what_is_asked",
]
