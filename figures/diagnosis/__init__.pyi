from .behaviour import behaviour_figure
from .cut import cut_orders_figure, cut_turn_figure
from .errors import draw_diagnosis
from .growth import growth_figure
from .law import law_figure
from .maps import channel_map_figure, time_map_figure
from .robot import robot_evidence_figure, robot_spectra_figure
from .spectra import spectra_figure

__all__ = [
    "behaviour_figure",
    "channel_map_figure",
    "cut_orders_figure",
    "cut_turn_figure",
    "draw_diagnosis",
    "growth_figure",
    "law_figure",
    "robot_evidence_figure",
    "robot_spectra_figure",
    "spectra_figure",
    "time_map_figure",
]
