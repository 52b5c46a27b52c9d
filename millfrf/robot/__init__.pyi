from .commands import robot_app
from .diagnosis import UNITS, refusal, told_number, what_is_asked

__all__ = [
    "UNITS",
    "refusal",
    "robot_app",
    "told_number",
    "what_is_asked",
]
