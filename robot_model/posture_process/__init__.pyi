from .learned_file import read_learned_postures, write_learned_postures
from .learning import LearnedPostures, learn_postures
from .posture_measurement import MeasuredPosture, measured_posture
from .predicting import PredictedPosture, predict_posture

__all__ = [
    "LearnedPostures",
    "MeasuredPosture",
    "PredictedPosture",
    "learn_postures",
    "measured_posture",
    "predict_posture",
    "read_learned_postures",
    "write_learned_postures",
]
