from .diagnosing import diagnose
from .predicting import Prediction, equivalent_receptance, improved_model_of, predict

__all__ = [
    "Prediction",
    "diagnose",
    "equivalent_receptance",
    "improved_model_of",
    "predict",
]
