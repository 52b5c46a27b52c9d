from .behaviour_of_modes import Behaviour, behaviour_of
from .families import FAMILIES, FOLLOWS_LEVEL, BehaviourSettings
from .level_refit import RefittedModes, refitted_modes
from .mode_trend import ModeTrend
from .own_refits import FollowedAlone, followed_alone

__all__ = [
    "FAMILIES",
    "FOLLOWS_LEVEL",
    "Behaviour",
    "BehaviourSettings",
    "FollowedAlone",
    "ModeTrend",
    "RefittedModes",
    "behaviour_of",
    "followed_alone",
    "refitted_modes",
]
