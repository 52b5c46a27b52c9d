from .diagnose_command import diagnose
from .diagnosing import Asking, diagnose_robot_files
from .diagnosis_words import UNITS, refusal, told_number, what_is_asked

__all__ = [
    "UNITS",
    "Asking",
    "diagnose",
    "diagnose_robot_files",
    "refusal",
    "told_number",
    "what_is_asked",
]
