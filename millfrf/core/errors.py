"""Exceptions and the warning class of the project, and the advice for files of other programs."""

import os
from pathlib import Path


class MillfrfError(Exception):
    """Base of every error this project raises on purpose; the command line ends with exit code 1."""


class InputError(MillfrfError):
    """An input cannot be used: a wrong value, unit, length or option (exit code 2)."""


class FileFormatError(InputError):
    """A file of the wrong kind or version, damaged, or without a field that it needs."""


class TooLarge(InputError):
    """A step would take more memory than is allowed; on another computer it may be possible."""


class DiskFull(MillfrfError):
    """The disk or quota is full. A recording keeps its acknowledged samples; other files stay as they were."""


class MillfrfWarning(UserWarning):
    """The result is valid, but its user should check an input or an assumption."""


_RECORDED = (".mat", ".csv", ".npz", ".npy", ".tdms", ".wav")
_EXCHANGED = (".uff", ".unv")


def conversion_advice(path: str | os.PathLike[str]) -> str:
    """Return the commands that convert a file of another program; an empty text for an unknown suffix.

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
