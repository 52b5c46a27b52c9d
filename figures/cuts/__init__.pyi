from .chatter import ShownCut, chatter_figure
from .lobes import LobesBand, TriedCut, lobes_figure
from .lobes_axes import draw_lobes

__all__ = [
    "LobesBand",
    "ShownCut",
    "TriedCut",
    "chatter_figure",
    "draw_lobes",
    "lobes_figure",
]
