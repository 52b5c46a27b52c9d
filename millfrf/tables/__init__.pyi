from .mode_shapes import shape_table, shapes_of
from .odds import evidence_in_words, odds_in_words
from .point_words import points_in_words
from .poles_table import poles_in_words
from .repeat_words import repeats_in_words
from .result_tables import Table, error_table, mode_table, show, with_error

__all__ = [
    "Table",
    "error_table",
    "evidence_in_words",
    "mode_table",
    "odds_in_words",
    "points_in_words",
    "poles_in_words",
    "repeats_in_words",
    "shape_table",
    "shapes_of",
    "show",
    "with_error",
]
