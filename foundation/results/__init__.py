"""The common part of all results: equality by value, a short text, a small HTML table, drawing, optional libraries."""

from .drawing import drawing
from .equality import same_values
from .optional import optional_library
from .result import Result
from .summary import Summary, counted, doubts_line, listed

__all__ = ["Result", "Summary", "counted", "doubts_line", "drawing", "listed", "optional_library", "same_values"]
