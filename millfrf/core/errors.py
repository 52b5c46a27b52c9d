"""Exceptions and the one warning class of the project, and the advice for files of other programs."""

import os
from pathlib import Path


class MillfrfError(Exception):
    """Base of every error this project raises on purpose; the command line ends with exit code 1."""


class InputError(MillfrfError):
    """Input that cannot be used: a wrong value, unit, length or option (exit code 2)."""


class FileFormatError(InputError):
    """A file is not what it should be: wrong kind, wrong version, damaged, or lacking a field."""


class TooLarge(InputError):
    """A job would take more memory than is allowed; elsewhere, or with another allowance, it may be done."""


class DiskFull(MillfrfError):
    """The disk or quota is full; of a recording, what was acknowledged before is kept; of other files, the old ones."""


class MillfrfWarning(UserWarning):
    """A doubt about what was given or found: the result stands, and its user should know of it."""


_RECORDED = (".mat", ".csv", ".npz", ".npy", ".tdms", ".wav")
_EXCHANGED = (".uff", ".unv")


def conversion_advice(path: str | os.PathLike[str]) -> str:
    """The commands that turn a file of another program into one made here; empty where its suffix tells none.

    Examples
    --------
    >>> print(conversion_advice("cut.mat"))
    convert it: millfrf new mapping cut.mat --out map.toml, then millfrf convert cut.mat cut.h5 --map map.toml
    """
    file = Path(path)
    target = f"{file.stem}.h5"
    if file.suffix.lower() in _RECORDED:
        return (
            f"convert it: millfrf new mapping {file.name} --out map.toml, then "
            f"millfrf convert {file.name} {target} --map map.toml"
        )
    if file.suffix.lower() in _EXCHANGED:
        return f"convert it: millfrf convert {file.name} {target}"
    return ""
