from .conversions import FRF_SUFFIXES, convert_files, is_frf_conversion
from .convert_uff import is_uff_conversion

__all__ = [
    "FRF_SUFFIXES",
    "convert_files",
    "is_frf_conversion",
    "is_uff_conversion",
]
