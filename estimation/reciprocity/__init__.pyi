from .drive_pairs import SharedPoint, shared_points
from .frf_reciprocity import ReciprocityPair, reciprocity_pairs

__all__ = [
    "ReciprocityPair",
    "SharedPoint",
    "reciprocity_pairs",
    "shared_points",
]
