from .child_processes import end_with, process_pool
from .degrees_of_freedom import HOUSING, TIP, DegreeOfFreedom, checked_names
from .errors import DiskFull, FileFormatError, InputError, MillfrfError, MillfrfWarning, TooLarge
from .foreign_files import conversion_advice
from .memory import allowed_bytes, require_memory
from .noted_table import WARNING, apart, warning_lines
from .notices import notice, notices_to
from .results import Result, Summary, counted, doubts_line, drawing, listed, optional_library, same_values
from .table_mistakes import mistake_in_words, shown
from .toml_tables import checked_toml
from .units import SI_UNITS, si_factor, unit_factor
from .valid_band import Band, checked_band, shared_band
from .whole_files import (
    LeftoverRemoved,
    free_name,
    is_disk_full,
    keeping_files,
    keeps_files,
    refuse_replacing,
    remove_leftovers,
    writing_whole_file,
    writing_whole_folder,
)

__all__ = [
    "HOUSING",
    "SI_UNITS",
    "TIP",
    "WARNING",
    "Band",
    "DegreeOfFreedom",
    "DiskFull",
    "FileFormatError",
    "InputError",
    "LeftoverRemoved",
    "MillfrfError",
    "MillfrfWarning",
    "Result",
    "Summary",
    "TooLarge",
    "allowed_bytes",
    "apart",
    "checked_band",
    "checked_names",
    "checked_toml",
    "conversion_advice",
    "counted",
    "doubts_line",
    "drawing",
    "end_with",
    "free_name",
    "is_disk_full",
    "keeping_files",
    "keeps_files",
    "listed",
    "mistake_in_words",
    "notice",
    "notices_to",
    "optional_library",
    "process_pool",
    "refuse_replacing",
    "remove_leftovers",
    "require_memory",
    "same_values",
    "shared_band",
    "shown",
    "si_factor",
    "unit_factor",
    "warning_lines",
    "writing_whole_file",
    "writing_whole_folder",
]
