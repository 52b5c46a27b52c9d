"""FRFs and modal models between this project's files and the Universal File Format."""

import os
from pathlib import Path

from estimation import read_frf, read_frf_uff, write_frf, write_frf_uff
from modal_fit import read_modal_model, read_modes_uff, write_modal_model, write_modes_uff

UFF_SUFFIXES = (".uff", ".unv")


def is_uff_conversion(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> bool:
    """Whether one side is a UFF file."""
    return any(Path(path).suffix.lower() in UFF_SUFFIXES for path in (source, target))


def convert_uff(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> None:
    """A modal model where either side is ``.json``, else an FRF; read and written by suffix.

    Raises
    ------
    InputError
        A file that cannot be used; nothing is written.
    """
    suffixes = [Path(path).suffix.lower() for path in (source, target)]
    if ".json" in suffixes:
        model = read_modes_uff(source) if suffixes[0] in UFF_SUFFIXES else read_modal_model(source)
        (write_modes_uff if suffixes[1] in UFF_SUFFIXES else write_modal_model)(target, model)
        return
    frf = read_frf_uff(source) if suffixes[0] in UFF_SUFFIXES else read_frf(source)
    if suffixes[1] in UFF_SUFFIXES:
        write_frf_uff(target, frf)
    else:
        write_frf(target, frf, title=f"from {Path(source).name}")
