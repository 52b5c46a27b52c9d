from .final_refit import LastFit, last_fit
from .prediction import OfferedModel, Prediction, improved_model_of, offered_model, predict
from .receptance_at_level import equivalent_receptance

__all__ = [
    "LastFit",
    "OfferedModel",
    "Prediction",
    "equivalent_receptance",
    "improved_model_of",
    "last_fit",
    "offered_model",
    "predict",
]
