from .learning import LearnedPostures, learn_postures
from .measured_posture import MeasuredPosture, measured_posture
from .predicting import PredictedPosture, predict_posture

__all__ = [
    "LearnedPostures",
    "MeasuredPosture",
    "PredictedPosture",
    "learn_postures",
    "measured_posture",
    "predict_posture",
]
