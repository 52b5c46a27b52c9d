"""FRFs of other programs: UFF, MAT, NPZ, CSV and the text exports of analysers."""

from .any_file import import_frf, looks_like_frf
from .entries import ImportedFrf
from .frf_mapping import FrfMapping, is_frf_mapping, load_frf_mapping
from .uff.frfs import UffChoice, import_uff, import_uffs, read_frf_uff

__all__ = [
    "FrfMapping",
    "ImportedFrf",
    "UffChoice",
    "import_frf",
    "import_uff",
    "import_uffs",
    "is_frf_mapping",
    "load_frf_mapping",
    "looks_like_frf",
    "read_frf_uff",
]
