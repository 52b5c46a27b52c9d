from .frfs import UffChoice, import_uff, import_uffs, read_frf_uff
from .uff_units import StatedUnit, given_unit

__all__ = [
    "StatedUnit",
    "UffChoice",
    "given_unit",
    "import_uff",
    "import_uffs",
    "read_frf_uff",
]
