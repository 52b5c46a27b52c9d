from .bands import Complex, Index, Real, checked_band, shared_band
from .content_hashes import accepting_edited
from .csv_tables import harmless, is_side_file, read_csv, side_file, side_note, side_text, write_csv
from .degrees_of_freedom import HOUSING, TIP, DegreeOfFreedom, checked_names
from .disk_errors import is_disk_full
from .errors import (
    DiskError,
    DiskFull,
    FileFormatError,
    InputError,
    MillfrfError,
    MillfrfWarning,
    TooLarge,
    command,
    conversion_advice,
)
from .json_files import read_json, write_json
from .results import Result, Summary, counted, doubts_line, drawing, listed, optional_library
from .runtime import allowed_bytes, end_with, notices_to, process_pool, require_memory
from .steps import Band, File, Names, Writes, names_of, step
from .tables import apart, checked_toml, mistake_in_words, tables_of_setup
from .unfinished_folders import LeftoverRemoved, remove_leftovers
from .units import SECONDS, SI_UNITS, is_unit, quantities_of, si_factor, time_unit, unit_factor, without_unit
from .whole_files import (
    free_name,
    keeping_files,
    refuse_replacing,
    writing_whole_file,
    writing_whole_folder,
)

__all__ = [
    "HOUSING",
    "SECONDS",
    "SI_UNITS",
    "TIP",
    "Band",
    "Complex",
    "DegreeOfFreedom",
    "DiskError",
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
    "accepting_edited",
    "allowed_bytes",
    "apart",
    "checked_band",
    "checked_names",
    "checked_toml",
    "command",
    "conversion_advice",
    "counted",
    "doubts_line",
    "drawing",
    "end_with",
    "free_name",
    "harmless",
    "is_disk_full",
    "is_side_file",
    "is_unit",
    "keeping_files",
    "listed",
    "mistake_in_words",
    "names_of",
    "notices_to",
    "optional_library",
    "process_pool",
    "quantities_of",
    "read_csv",
    "read_json",
    "refuse_replacing",
    "remove_leftovers",
    "require_memory",
    "shared_band",
    "si_factor",
    "side_file",
    "side_note",
    "side_text",
    "step",
    "tables_of_setup",
    "time_unit",
    "unit_factor",
    "without_unit",
    "write_csv",
    "write_json",
    "writing_whole_file",
    "writing_whole_folder",
]
