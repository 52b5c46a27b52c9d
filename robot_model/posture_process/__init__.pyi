from .learned_file import read_learned_postures, write_learned_postures
from .learning import LearnedPostures, learn_postures
from .left_out import LeftOutPosture, left_out_postures
from .modes import MeasuredModes, measured_modes
from .next_postures import ChosenPosture, choose_postures
from .predicting import PredictedPosture, predict_posture

__all__ = [
    "ChosenPosture",
    "LearnedPostures",
    "LeftOutPosture",
    "MeasuredModes",
    "PredictedPosture",
    "choose_postures",
    "learn_postures",
    "left_out_postures",
    "measured_modes",
    "predict_posture",
    "read_learned_postures",
    "write_learned_postures",
]
