from .fitting import CutFit, fit_cut
from .free_numbers import FreeNumbers
from .hypothesis import CutHypothesis
from .measured_cut import MeasuredCut
from .start import fit_turned, started

__all__ = [
    "CutFit",
    "CutHypothesis",
    "FreeNumbers",
    "MeasuredCut",
    "fit_cut",
    "fit_turned",
    "started",
]
