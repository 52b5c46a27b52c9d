from .diagnosing import diagnose
from .improved_model import improved_model_of
from .prediction import Prediction, predict
from .receptance_at_level import equivalent_receptance

__all__ = [
    "Prediction",
    "diagnose",
    "equivalent_receptance",
    "improved_model_of",
    "predict",
]
