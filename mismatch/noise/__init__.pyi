from .line_loops import size_of_white, whitened_columns
from .noise_model import NoiseModel, fit_noise, flat_noise, inexactness, whitening, whitening_and_determinant

__all__ = [
    "NoiseModel",
    "fit_noise",
    "flat_noise",
    "inexactness",
    "size_of_white",
    "whitened_columns",
    "whitening",
    "whitening_and_determinant",
]
