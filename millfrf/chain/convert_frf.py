"""FRF files between this project's HDF5 and the Universal File Format."""

import os
from pathlib import Path

from estimation import read_frf, read_frf_uff, write_frf, write_frf_uff

UFF_SUFFIXES = (".uff", ".unv")


def is_frf_conversion(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> bool:
    """Whether one side is a UFF file: those hold FRFs here."""
    return any(Path(path).suffix.lower() in UFF_SUFFIXES for path in (source, target))


def convert_frf(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> None:
    """Read an FRF by suffix and write it by suffix.

    Raises
    ------
    InputError
        A file that cannot be used; nothing is written.
    """
    frf = read_frf_uff(source) if Path(source).suffix.lower() in UFF_SUFFIXES else read_frf(source)
    if Path(target).suffix.lower() in UFF_SUFFIXES:
        write_frf_uff(target, frf)
    else:
        write_frf(target, frf, title=f"from {Path(source).name}")
