from .drilled_holes import Accuracy, DrillingArea, show_deviation
from .statics import show_stiffness

__all__ = [
    "Accuracy",
    "DrillingArea",
    "show_deviation",
    "show_stiffness",
]
