from .drilled_holes import Accuracy, DrillingArea, show_deviation
from .running_out import RunningOut
from .statics import show_stiffness

__all__ = [
    "Accuracy",
    "DrillingArea",
    "RunningOut",
    "show_deviation",
    "show_stiffness",
]
