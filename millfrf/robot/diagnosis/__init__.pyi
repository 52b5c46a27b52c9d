from .diagnose_command import diagnose
from .diagnosis_words import UNITS, told_number, what_is_asked

__all__ = [
    "UNITS",
    "diagnose",
    "told_number",
    "what_is_asked",
]
