from .path_picture import draw_path, path_figure
from .path_table import write_path_table
from .path_words import doubts, summary

__all__ = [
    "doubts",
    "draw_path",
    "path_figure",
    "summary",
    "write_path_table",
]
