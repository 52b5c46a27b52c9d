"""Mode shapes of a model, measured: likeness of modes, and how far each is from a real one."""

from .complexity import mode_complexity
from .shape_summary import ModeShapes, mode_shapes
from .vector_reciprocity import ModeReciprocity, mode_reciprocity

__all__ = ["ModeReciprocity", "ModeShapes", "mode_complexity", "mode_reciprocity", "mode_shapes"]
