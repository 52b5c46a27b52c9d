from .details import CutDetails, CutDiagnosis, write_improved_cut
from .diagnose import diagnose_cut
from .fits import CutFit
from .force import COEFFICIENT_NAMES
from .naming import COEFFICIENTS
from .recordings import CutChatter, CutRecording, SpindleLaw, cut_recording, read_cut_recording, require_room_for_cut
from .settings import CUT, CutSettings

__all__ = [
    "COEFFICIENTS",
    "COEFFICIENT_NAMES",
    "CUT",
    "CutChatter",
    "CutDetails",
    "CutDiagnosis",
    "CutFit",
    "CutRecording",
    "CutSettings",
    "SpindleLaw",
    "cut_recording",
    "diagnose_cut",
    "read_cut_recording",
    "require_room_for_cut",
    "write_improved_cut",
]
