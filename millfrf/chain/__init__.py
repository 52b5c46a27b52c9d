"""The steps of the main job, as the commands and the demonstration both call them."""

from .calibrate import calibrate_model
from .estimate import estimate_recordings
from .estimate_options import Estimate, EstimateOptions
from .fit import fit_model, fit_recordings
from .fit_options import FitOptions
from .lobes import LOBE_METHODS, compute_lobes, speed_axis

__all__ = [
    "LOBE_METHODS",
    "Estimate",
    "EstimateOptions",
    "FitOptions",
    "calibrate_model",
    "compute_lobes",
    "estimate_recordings",
    "fit_model",
    "fit_recordings",
    "speed_axis",
]
