"""Was a recorded cut stable?"""

from .classify import classify_cut
from .evidence import Evidence, gather_evidence
from .verdict import ChatterVerdict, ForeignTone

__all__ = ["ChatterVerdict", "Evidence", "ForeignTone", "classify_cut", "gather_evidence"]
