from .chatter import ShownCut, chatter_figure
from .islands import StableAbove
from .lobes import LobesBand, TriedCut, depth_axis_top, lobes_figure
from .lobes_axes import draw_lobes

__all__ = [
    "LobesBand",
    "ShownCut",
    "StableAbove",
    "TriedCut",
    "chatter_figure",
    "depth_axis_top",
    "draw_lobes",
    "lobes_figure",
]
