"""Mode shapes of a model, measured: likeness of modes, and how far each is from a real one."""

from .complexity import mode_complexity
from .shape_summary import ModeShapes, mode_shapes

__all__ = ["ModeShapes", "mode_complexity", "mode_shapes"]
