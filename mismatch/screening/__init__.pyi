from .beside_laws import Gains, gains_beside_laws
from .chain_screening import ScreenedChain, screen_chains
from .joint_direction import JointSighting, SeenMotion, find_direction, seen_motion
from .joint_laws_fitted import SightedLaws, joint_candidates, sighted_laws
from .joint_screening import screen_joints
from .joint_starts import phases_too_large
from .laws_at_one_place import laws_beyond, laws_in_place, twin_laws
from .level_continuation import laws_by_level
from .linear_causes_fitted import channel_of, linear_candidates
from .missing_mode import SightedMode, find_mode
from .whitened_residual import Floor, FloorRecord, linear_floor, noise_floor

__all__ = [
    "Floor",
    "FloorRecord",
    "Gains",
    "JointSighting",
    "ScreenedChain",
    "SeenMotion",
    "SightedLaws",
    "SightedMode",
    "channel_of",
    "find_direction",
    "find_mode",
    "gains_beside_laws",
    "joint_candidates",
    "laws_beyond",
    "laws_by_level",
    "laws_in_place",
    "linear_candidates",
    "linear_floor",
    "noise_floor",
    "phases_too_large",
    "screen_chains",
    "screen_joints",
    "seen_motion",
    "sighted_laws",
    "twin_laws",
]
