"""The steps of the main job, as the commands and the demonstration both call them."""

from .cuts.lobes import LOBE_METHODS, compute_lobes, speed_axis
from .estimating.estimate import estimate_recordings
from .estimating.estimate_options import Estimate, EstimateOptions
from .fitting.calibrate import calibrate_model
from .fitting.fit import fit_model, fit_recordings
from .fitting.fit_options import FitOptions

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
