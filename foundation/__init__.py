"""What every room stands on: named errors, whole-file writing, units and degrees of freedom.

Nothing here knows about signals, models or the command line.
"""

from foundation.atomic_files import writing_whole_file
from foundation.degrees_of_freedom import DegreeOfFreedom
from foundation.errors import FileFormatError, InputError, MillfrfError
from foundation.units import SI_UNITS, si_factor

__all__ = [
    "SI_UNITS",
    "DegreeOfFreedom",
    "FileFormatError",
    "InputError",
    "MillfrfError",
    "si_factor",
    "writing_whole_file",
]
