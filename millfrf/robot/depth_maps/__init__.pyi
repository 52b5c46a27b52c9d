from .posture_maps import depth_over_places, depth_over_redundancy, write_posture_map
from .workspace_map import Area, certified_over_places, first_postures, write_workspace_map

__all__ = [
    "Area",
    "certified_over_places",
    "depth_over_places",
    "depth_over_redundancy",
    "first_postures",
    "write_posture_map",
    "write_workspace_map",
]
