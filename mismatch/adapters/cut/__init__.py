"""Which physics a computed cutting force leaves out: measured forces of a cut against those of a cutting process."""

from .cut_diagnosis import FORCE_ERROR, NOISE_LIKE, diagnose_cut
from .cut_diagnosis_file import cut_diagnosis_content, write_cut_diagnosis, write_improved_cut
from .cut_held_out import SIGNIFICANT
from .cut_results import COEFFICIENTS, CutDiagnosis
from .recordings.cut_chatter import CutChatter
from .recordings.cut_reading import read_cut_recording
from .recordings.cut_recording import CutRecording, cut_recording
from .recordings.spindle_law import SpindleLaw

__all__ = [
    "COEFFICIENTS",
    "FORCE_ERROR",
    "NOISE_LIKE",
    "SIGNIFICANT",
    "CutChatter",
    "CutDiagnosis",
    "CutRecording",
    "SpindleLaw",
    "cut_diagnosis_content",
    "cut_recording",
    "diagnose_cut",
    "read_cut_recording",
    "write_cut_diagnosis",
    "write_improved_cut",
]
