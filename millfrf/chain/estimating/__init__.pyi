from .estimate import estimate_of_spectra, estimate_recordings, write_estimate
from .estimate_options import LOCAL, Estimate, EstimateOptions, check_options
from .spectra_of_recordings import (
    check_equal_rates,
    gain_of_test,
    spectra_of_test,
    spectra_of_tests,
    with_instruments,
)

__all__ = [
    "LOCAL",
    "Estimate",
    "EstimateOptions",
    "check_equal_rates",
    "check_options",
    "estimate_of_spectra",
    "estimate_recordings",
    "gain_of_test",
    "spectra_of_test",
    "spectra_of_tests",
    "with_instruments",
    "write_estimate",
]
