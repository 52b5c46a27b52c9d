from .posture_maps import depth_over_places, depth_over_redundancy, write_posture_map

__all__ = [
    "depth_over_places",
    "depth_over_redundancy",
    "write_posture_map",
]
