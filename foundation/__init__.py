"""What every room stands on: named errors, whole-file writing, units and degrees of freedom.

Nothing here knows about signals, models or the command line.
"""

from .atomic_files import writing_whole_file
from .degrees_of_freedom import DegreeOfFreedom
from .errors import FileFormatError, InputError, MillfrfError, MillfrfWarning
from .noted_table import WARNING, apart, warning_lines
from .results import Result, Summary, counted, drawing, listed, optional_library, same_values
from .table_mistakes import mistake_in_words, shown
from .units import SI_UNITS, si_factor, unit_factor
from .valid_band import Band, checked_band, shared_band

__all__ = [
    "SI_UNITS",
    "WARNING",
    "Band",
    "DegreeOfFreedom",
    "FileFormatError",
    "InputError",
    "MillfrfError",
    "MillfrfWarning",
    "Result",
    "Summary",
    "apart",
    "checked_band",
    "counted",
    "drawing",
    "listed",
    "mistake_in_words",
    "optional_library",
    "same_values",
    "shared_band",
    "shown",
    "si_factor",
    "unit_factor",
    "warning_lines",
    "writing_whole_file",
]
