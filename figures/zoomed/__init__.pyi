from .chart import picking_chart, zoomed_chart
from .frf import EntryCurves, zoomed_frfs
from .indicators import zoomed_indicators
from .limits import zoomed_limits
from .matrix import zoomed_matrix
from .plot import ZoomedPlot, browser_library
from .sums import zoomed_sums

__all__ = [
    "EntryCurves",
    "ZoomedPlot",
    "browser_library",
    "picking_chart",
    "zoomed_chart",
    "zoomed_frfs",
    "zoomed_indicators",
    "zoomed_limits",
    "zoomed_matrix",
    "zoomed_sums",
]
