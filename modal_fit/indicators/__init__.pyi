from .complex_indicator import ComplexModeIndicator, IndicatorPeak, complex_mode_indicator
from .multivariate_indicator import MultivariateModeIndicator, multivariate_mode_indicator

__all__ = [
    "ComplexModeIndicator",
    "IndicatorPeak",
    "MultivariateModeIndicator",
    "complex_mode_indicator",
    "multivariate_mode_indicator",
]
