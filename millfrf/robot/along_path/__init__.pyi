from .asked_path import AskedPath
from .certified_search import Wanted
from .number_of_modes import KeptModes, kept_modes
from .optimum import PathOptimum, optimised
from .path_state import Loading, PathState, state_of
from .posture_values import PathCut, PostureValues, Request, values_of
from .telling import draw_path, path_figure, write_path_table
from .write_path import write_optimised_path

__all__ = [
    "AskedPath",
    "KeptModes",
    "Loading",
    "PathCut",
    "PathOptimum",
    "PathState",
    "PostureValues",
    "Request",
    "Wanted",
    "draw_path",
    "kept_modes",
    "optimised",
    "path_figure",
    "state_of",
    "values_of",
    "write_optimised_path",
    "write_path_table",
]
