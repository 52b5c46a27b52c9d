from .across_poses import families
from .named_modes import IdentifiedModes, ModeOfPose, identify_modes
from .one_mode import SeenMode, seen_modes
from .pairing import Pairing, pair_modes
from .within_pose import tracks_of_pose

__all__ = [
    "IdentifiedModes",
    "ModeOfPose",
    "Pairing",
    "SeenMode",
    "families",
    "identify_modes",
    "pair_modes",
    "seen_modes",
    "tracks_of_pose",
]
