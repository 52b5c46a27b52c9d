from .frf import FrfCurves, coherent_lines, frf_figures
from .frf_axes import draw_frf
from .gallery import ENTRIES_PER_PAGE, GalleryEntry, gallery_page
from .inputs import input_figure
from .reciprocity import reciprocity_figure
from .recording import time_figure
from .recording_axes import draw_stream
from .spectra_axes import draw_spectra

__all__ = [
    "ENTRIES_PER_PAGE",
    "FrfCurves",
    "GalleryEntry",
    "coherent_lines",
    "draw_frf",
    "draw_spectra",
    "draw_stream",
    "frf_figures",
    "gallery_page",
    "input_figure",
    "reciprocity_figure",
    "time_figure",
]
