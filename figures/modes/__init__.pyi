from .indicators import indicator_figure
from .mode import mode_figure
from .model_axes import draw_model
from .moving import MovingShapes, moving_shapes, shapes_figure
from .shapes import assurance_figure, compass_figure
from .stabilisation import stabilisation_figure
from .synthesis import synthesis_figure

__all__ = [
    "MovingShapes",
    "assurance_figure",
    "compass_figure",
    "draw_model",
    "indicator_figure",
    "mode_figure",
    "moving_shapes",
    "shapes_figure",
    "stabilisation_figure",
    "synthesis_figure",
]
