"""Was a recorded cut stable?"""

from .classify import classify_cut
from .fitted_depth import ModelledCut
from .judged_spectrum import CutSpectrum, cut_spectrum
from .motion import Evidence, gather_evidence
from .verdict import ChatterVerdict, ForeignTone

__all__ = [
    "ChatterVerdict",
    "CutSpectrum",
    "Evidence",
    "ForeignTone",
    "ModelledCut",
    "classify_cut",
    "cut_spectrum",
    "gather_evidence",
]
