"""What every room stands on: named errors, whole-file writing, units and degrees of freedom.

Nothing here knows about signals, models or the command line.
"""

from foundation.atomic_files import writing_whole_file
from foundation.degrees_of_freedom import DegreeOfFreedom
from foundation.errors import FileFormatError, InputError, MillfrfError
from foundation.table_mistakes import mistake_in_words, shown
from foundation.units import SI_UNITS, si_factor
from foundation.valid_band import Band, checked_band, shared_band

__all__ = [
    "SI_UNITS",
    "Band",
    "DegreeOfFreedom",
    "FileFormatError",
    "InputError",
    "MillfrfError",
    "checked_band",
    "mistake_in_words",
    "shared_band",
    "shown",
    "si_factor",
    "writing_whole_file",
]
