from .likelihood_model import Setting
from .likelihood_result import best_fit, modal_model_from
from .linear_start import regressors
from .noise_levels import NoiseLevels
from .whole_records import RecordSpectra, record_spectra

__all__ = [
    "NoiseLevels",
    "RecordSpectra",
    "Setting",
    "best_fit",
    "modal_model_from",
    "record_spectra",
    "regressors",
]
