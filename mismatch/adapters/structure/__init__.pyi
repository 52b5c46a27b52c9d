from .diagnosing import diagnose
from .prediction import Prediction, improved_model_of, predict
from .receptance_at_level import equivalent_receptance

__all__ = [
    "Prediction",
    "diagnose",
    "equivalent_receptance",
    "improved_model_of",
    "predict",
]
