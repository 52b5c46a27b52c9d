from .calibrate import calibrate_model, write_calibration
from .fit import fit_model, fit_recordings, write_fit
from .fit_options import METHODS, POLYREFERENCE, SUBSPACE, FitOptions, chart_from_json
from .pole_picking import check_candidates, picked_in_words, write_candidates

__all__ = [
    "METHODS",
    "POLYREFERENCE",
    "SUBSPACE",
    "FitOptions",
    "calibrate_model",
    "chart_from_json",
    "check_candidates",
    "fit_model",
    "fit_recordings",
    "picked_in_words",
    "write_calibration",
    "write_candidates",
    "write_fit",
]
