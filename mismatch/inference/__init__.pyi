from .comparison import Comparison, Fitted, Proposal, Round, Search, best_first, equivalents_of
from .descent import Descended, Limits, Problem, bounded_step, descend, plain_step
from .diagnosis import VERDICTS, AcceptedCause, Candidate, Diagnosis, HeldOutError, Improvement
from .diagnosis_file import diagnosis_content, read_diagnosis, write_diagnosis
from .form_errors import jackknife_variance, shift_weight
from .forward_search import Patience, Progress, emptied, pruned, released, search
from .paired_tests import ratio_interval, signed_ranks, students_test
from .process_pool import in_processes
from .remainder import Remainder
from .settings import (
    FAULTS,
    LOCATION,
    EvidenceSettings,
    FaultSettings,
    LocationSettings,
    ProofSettings,
    ScreeningSettings,
    SearchSettings,
    Settings,
    VerdictSettings,
)
from .thresholds import LabError, Thresholds
from .verdict import Findings, error_halved, leaves_too_much, share_left, verdict_of

__all__ = [
    "FAULTS",
    "LOCATION",
    "VERDICTS",
    "AcceptedCause",
    "Candidate",
    "Comparison",
    "Descended",
    "Diagnosis",
    "EvidenceSettings",
    "FaultSettings",
    "Findings",
    "Fitted",
    "HeldOutError",
    "Improvement",
    "LabError",
    "Limits",
    "LocationSettings",
    "Patience",
    "Problem",
    "Progress",
    "ProofSettings",
    "Proposal",
    "Remainder",
    "Round",
    "ScreeningSettings",
    "Search",
    "SearchSettings",
    "Settings",
    "Thresholds",
    "VerdictSettings",
    "best_first",
    "bounded_step",
    "descend",
    "diagnosis_content",
    "emptied",
    "equivalents_of",
    "error_halved",
    "in_processes",
    "jackknife_variance",
    "leaves_too_much",
    "plain_step",
    "pruned",
    "ratio_interval",
    "read_diagnosis",
    "released",
    "search",
    "share_left",
    "shift_weight",
    "signed_ranks",
    "students_test",
    "verdict_of",
    "write_diagnosis",
]
