"""The folder of ``--out``."""

from pathlib import Path

from millfrf.core import InputError


def refuse_file(folder: Path) -> None:
    """Check before long work that results can go there.

    Raises
    ------
    InputError
        There is a file of that name.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is a file; name a folder with --out")
