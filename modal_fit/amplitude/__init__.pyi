from .dependence import AmplitudeDependence, ModeChange, amplitude_dependence
from .level_fit import LevelFit, fit_level

__all__ = [
    "AmplitudeDependence",
    "LevelFit",
    "ModeChange",
    "amplitude_dependence",
    "fit_level",
]
