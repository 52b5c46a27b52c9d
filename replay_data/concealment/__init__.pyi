from .concealed_cell import FINE_RATE, LEVELS, ConcealedCell, milling_force
from .concealed_effect import FOREIGN, ConcealedEffect, draw_effect, draw_name, joint_scale
from .random_posture import posture_robot

__all__ = [
    "FINE_RATE",
    "FOREIGN",
    "LEVELS",
    "ConcealedCell",
    "ConcealedEffect",
    "draw_effect",
    "draw_name",
    "joint_scale",
    "milling_force",
    "posture_robot",
]
