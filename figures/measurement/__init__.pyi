from .frf import SYMBOLS, FrfCurves, coherent_lines, frf_figures, lines_in_band, model_axis, model_entry
from .frf_axes import draw_frf
from .gallery import ENTRIES_PER_PAGE, GalleryEntry, gallery_page
from .inputs import input_figure
from .reciprocity import reciprocity_figure
from .recording import time_figure
from .recording_axes import draw_stream
from .spectra_axes import draw_spectra

__all__ = [
    "ENTRIES_PER_PAGE",
    "SYMBOLS",
    "FrfCurves",
    "GalleryEntry",
    "coherent_lines",
    "draw_frf",
    "draw_spectra",
    "draw_stream",
    "frf_figures",
    "gallery_page",
    "input_figure",
    "lines_in_band",
    "model_axis",
    "model_entry",
    "reciprocity_figure",
    "time_figure",
]
