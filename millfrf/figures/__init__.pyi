from .advice import Advice, SheetContent, advice_figure, sheet_figure
from .cut_forces import cut_coefficients_figure
from .cut_in_time import simulated_figure, wall_figure
from .cut_over_time import RecordedCut, cut_over_time_figure
from .cuts import LobesBand, ShownCut, StableAbove, TriedCut, chatter_figure, draw_lobes, lobes_figure, shows_chatter
from .diagnosis import behaviour_figure, cut_orders_figure, cut_turn_figure, draw_diagnosis, growth_figure, law_figure
from .diagnosis_maps import (
    channel_map_figure,
    robot_evidence_figure,
    robot_spectra_figure,
    spectra_figure,
    time_map_figure,
)
from .frf import FrfCurves, coherent_lines, draw_frf, frf_figures
from .gallery import ENTRIES_PER_PAGE, GalleryEntry, SmallSvg, as_data_uri, as_png, gallery_page, save_figure
from .learning import learned_figure
from .measurement import draw_spectra, draw_stream, input_figure, reciprocity_figure, time_figure
from .modes import draw_model, indicator_figure, mode_figure, stabilisation_figure, synthesis_figure
from .shapes import MovingShapes, assurance_figure, compass_figure, moving_shapes, shapes_figure
from .style import COLOURS, LINE_STYLES, SHADE, house_style, new_figure, panel_letter
from .tool_tips import tool_tip_figure
from .zoomed import (
    ZoomedPlot,
    browser_library,
    picking_chart,
    zoomed_chart,
    zoomed_indicators,
    zoomed_sums,
)
from .zoomed_frf import (
    EntryCurves,
    curve_columns,
    frf_panels,
    limits_panels,
    zoomed_frfs,
    zoomed_limits,
    zoomed_matrix,
)

__all__ = [
    "COLOURS",
    "ENTRIES_PER_PAGE",
    "LINE_STYLES",
    "SHADE",
    "Advice",
    "EntryCurves",
    "FrfCurves",
    "GalleryEntry",
    "LobesBand",
    "MovingShapes",
    "RecordedCut",
    "SheetContent",
    "ShownCut",
    "SmallSvg",
    "StableAbove",
    "TriedCut",
    "ZoomedPlot",
    "advice_figure",
    "as_data_uri",
    "as_png",
    "assurance_figure",
    "behaviour_figure",
    "browser_library",
    "channel_map_figure",
    "chatter_figure",
    "coherent_lines",
    "compass_figure",
    "curve_columns",
    "cut_coefficients_figure",
    "cut_orders_figure",
    "cut_over_time_figure",
    "cut_turn_figure",
    "draw_diagnosis",
    "draw_frf",
    "draw_lobes",
    "draw_model",
    "draw_spectra",
    "draw_stream",
    "frf_figures",
    "frf_panels",
    "gallery_page",
    "growth_figure",
    "house_style",
    "indicator_figure",
    "input_figure",
    "law_figure",
    "learned_figure",
    "limits_panels",
    "lobes_figure",
    "mode_figure",
    "moving_shapes",
    "new_figure",
    "panel_letter",
    "picking_chart",
    "reciprocity_figure",
    "robot_evidence_figure",
    "robot_spectra_figure",
    "save_figure",
    "shapes_figure",
    "sheet_figure",
    "shows_chatter",
    "simulated_figure",
    "spectra_figure",
    "stabilisation_figure",
    "synthesis_figure",
    "time_figure",
    "time_map_figure",
    "tool_tip_figure",
    "wall_figure",
    "zoomed_chart",
    "zoomed_frfs",
    "zoomed_indicators",
    "zoomed_limits",
    "zoomed_matrix",
    "zoomed_sums",
]
