from .diagnose_command import diagnose
from .diagnosis_words import UNITS, refusal, told_number, what_is_asked

__all__ = [
    "UNITS",
    "diagnose",
    "refusal",
    "told_number",
    "what_is_asked",
]
