"""The comparison of a modal model with recordings of forces and responses."""

from .diagnosing import diagnose
from .improved_model import improved_model_of
from .prediction import Prediction, predict

__all__ = ["Prediction", "diagnose", "improved_model_of", "predict"]
