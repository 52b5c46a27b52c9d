from .depth_band import DepthBand
from .learned_lobes import write_learned_lobes
from .learned_receptance import predicted_in, write_learned_receptance
from .learning_files import LearningFrom, driven_of, learn_from_files
from .posture_choice import WorkArea

__all__ = [
    "DepthBand",
    "LearningFrom",
    "WorkArea",
    "driven_of",
    "learn_from_files",
    "predicted_in",
    "write_learned_lobes",
    "write_learned_receptance",
]
