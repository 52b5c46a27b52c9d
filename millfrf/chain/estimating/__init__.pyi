from .estimate import estimate_recordings, spectra_of_tests, write_estimate
from .estimate_options import LOCAL, Estimate, EstimateOptions

__all__ = [
    "LOCAL",
    "Estimate",
    "EstimateOptions",
    "estimate_recordings",
    "spectra_of_tests",
    "write_estimate",
]
