"""Was a recorded cut stable?"""

from .classify import classify_cut
from .fitted_depth import ModelledCut
from .motion import Evidence, gather_evidence
from .verdict import ChatterVerdict, ForeignTone

__all__ = ["ChatterVerdict", "Evidence", "ForeignTone", "ModelledCut", "classify_cut", "gather_evidence"]
