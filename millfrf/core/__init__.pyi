from .arrays import Complex, Index, Real
from .bands import checked_band, shared_band
from .degrees_of_freedom import HOUSING, TIP, DegreeOfFreedom, checked_names
from .errors import DiskFull, FileFormatError, InputError, MillfrfError, MillfrfWarning, TooLarge, conversion_advice
from .results import Result, Summary, counted, doubts_line, drawing, listed, optional_library
from .runtime import allowed_bytes, end_with, notices_to, process_pool, require_memory
from .steps import Band, File, Names, Writes, names_of, step
from .tables import apart, checked_toml, mistake_in_words, warning_lines
from .units import SI_UNITS, si_factor, unit_factor
from .whole_files import (
    LeftoverRemoved,
    free_name,
    is_disk_full,
    keeping_files,
    refuse_replacing,
    remove_leftovers,
    writing_whole_file,
    writing_whole_folder,
)

__all__ = [
    "HOUSING",
    "SI_UNITS",
    "TIP",
    "Band",
    "Complex",
    "DegreeOfFreedom",
    "DiskFull",
    "File",
    "FileFormatError",
    "Index",
    "InputError",
    "LeftoverRemoved",
    "MillfrfError",
    "MillfrfWarning",
    "Names",
    "Real",
    "Result",
    "Summary",
    "TooLarge",
    "Writes",
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
    "listed",
    "mistake_in_words",
    "names_of",
    "notices_to",
    "optional_library",
    "process_pool",
    "refuse_replacing",
    "remove_leftovers",
    "require_memory",
    "shared_band",
    "si_factor",
    "step",
    "unit_factor",
    "warning_lines",
    "writing_whole_file",
    "writing_whole_folder",
]
