from .chatter_frequency import strongest_line
from .crossings import Crossings, find_crossings, followed, moved_depths
from .depth_stages import safe_depth
from .unit_circle import CircleCrossings, circle_crossings

__all__ = [
    "CircleCrossings",
    "Crossings",
    "circle_crossings",
    "find_crossings",
    "followed",
    "moved_depths",
    "safe_depth",
    "strongest_line",
]
