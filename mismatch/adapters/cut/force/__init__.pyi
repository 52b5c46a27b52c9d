from .coefficients import COEFFICIENT_NAMES, Belief
from .force_computation import Acting, chip_thickness, computed_force
from .noise import ForceNoise, noise_of, whitened
from .spectra import ForceSpectra, force_spectra
from .tooth_views import CutView, fineness, view_of

__all__ = [
    "COEFFICIENT_NAMES",
    "Acting",
    "Belief",
    "CutView",
    "ForceNoise",
    "ForceSpectra",
    "chip_thickness",
    "computed_force",
    "fineness",
    "force_spectra",
    "noise_of",
    "view_of",
    "whitened",
]
