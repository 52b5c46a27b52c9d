from .learned_receptance import predicted_in, write_learned_receptance
from .learning_files import LearningFrom, learn_from_files

__all__ = ["LearningFrom", "learn_from_files", "predicted_in", "write_learned_receptance"]
