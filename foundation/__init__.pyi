from .atomic_files import writing_whole_file
from .degrees_of_freedom import HOUSING, TIP, DegreeOfFreedom
from .errors import FileFormatError, InputError, MillfrfError, MillfrfWarning
from .noted_table import WARNING, apart, warning_lines
from .results import Result, Summary, counted, doubts_line, drawing, listed, optional_library, same_values
from .table_mistakes import mistake_in_words, shown
from .toml_tables import checked_toml
from .units import SI_UNITS, si_factor, unit_factor
from .valid_band import Band, checked_band, shared_band

__all__ = [
    "HOUSING",
    "SI_UNITS",
    "TIP",
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
    "checked_toml",
    "counted",
    "doubts_line",
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
