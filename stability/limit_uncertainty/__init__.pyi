from .first_order import depth_errors, probability_of_stability, speeds_within, usable_limits
from .limit_interval import LimitBand, limit_band
from .limit_samples import drawn, sampled_limits
from .limit_sensitivity import LimitSensitivity, limit_sensitivities

__all__ = [
    "LimitBand",
    "LimitSensitivity",
    "depth_errors",
    "drawn",
    "limit_band",
    "limit_sensitivities",
    "probability_of_stability",
    "sampled_limits",
    "speeds_within",
    "usable_limits",
]
