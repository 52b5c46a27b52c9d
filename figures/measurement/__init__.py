"""Figures of what was measured: recordings, inputs, FRFs and their reciprocity."""

from .frf import FrfCurves, coherent_lines, frf_figures
from .gallery import ENTRIES_PER_PAGE, GalleryEntry, gallery_page
from .inputs import input_figure
from .reciprocity import reciprocity_figure
from .recording import time_figure

__all__ = [
    "ENTRIES_PER_PAGE",
    "FrfCurves",
    "GalleryEntry",
    "coherent_lines",
    "frf_figures",
    "gallery_page",
    "input_figure",
    "reciprocity_figure",
    "time_figure",
]
