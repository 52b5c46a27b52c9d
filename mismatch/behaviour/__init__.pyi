from .behaviour_of_modes import Behaviour, behaviour_of
from .families import FAMILIES, BehaviourSettings
from .level_refit import RefittedModes, refitted_modes
from .mode_trend import ModeTrend

__all__ = [
    "FAMILIES",
    "Behaviour",
    "BehaviourSettings",
    "ModeTrend",
    "RefittedModes",
    "behaviour_of",
    "refitted_modes",
]
