from .commands import robot_app
from .diagnosis import UNITS, told_number, what_is_asked

__all__ = [
    "UNITS",
    "robot_app",
    "told_number",
    "what_is_asked",
]
