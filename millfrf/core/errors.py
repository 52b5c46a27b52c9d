"""Exceptions and the warning class of the project, and the advice for files of other programs."""

import os
import re
import shlex
from pathlib import Path


class MillfrfError(Exception):
    """Base of every error this project raises on purpose; the command line ends with exit code 1."""


class InputError(MillfrfError):
    """An input cannot be used: a wrong value, unit, length or option (exit code 2)."""


class FileFormatError(InputError):
    """A file of the wrong kind or version, damaged, or without a field that it needs."""


class TooLarge(InputError):
    """A step would take more memory than is allowed; on another computer it may be possible."""


class DiskError(MillfrfError):
    """A disk failed, or another program removed or replaced a file while it was written (exit code 1)."""


class DiskFull(DiskError):
    """The disk or quota is full. A recording keeps its acknowledged samples; other files stay as they were."""


class NotKept(DiskError):
    """A file was written, but its disk did not keep all of it, or another program has taken it away."""


class MillfrfWarning(UserWarning):
    """The result is valid, but its user should check an input or an assumption."""


_RECORDED = (".mat", ".csv", ".npz", ".npy", ".tdms", ".mf4", ".wav", ".txt", ".lvm", ".asc", ".dat", ".tsv")
_TEXT = (".csv", ".txt", ".asc", ".dat", ".tsv")
_EXCHANGED = (".uff", ".unv")
# data sets of UFF: functions of time or frequency, and what is no function
_FUNCTION, _MODES, _GEOMETRY = 58, (55, 2414), (15, 2411, 781, 82, 2412, 2431)
_FRF, _TIME = 4, 1  # types of functions
_EXAMINED = 1 << 26  # bytes of a file that are examined for an advice


def command(*words: str | os.PathLike[str]) -> str:
    """Return a command line as it is typed: names with blanks are quoted.

    Examples
    --------
    >>> command("inspect", "first cut.h5")
    "millfrf inspect 'first cut.h5'"
    """
    return shlex.join(["millfrf", *map(str, words)])


def conversion_advice(path: str | os.PathLike[str]) -> str:
    """Return the commands that convert a file of another program, by its content; empty for an unknown suffix.

    Examples
    --------
    >>> print(conversion_advice("cut.mat"))
    convert it: millfrf new mapping cut.mat --out map.toml, then millfrf convert cut.mat cut.h5 --map map.toml
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix not in (*_RECORDED, *_EXCHANGED):
        return ""
    target = _target(file)
    if target:
        return f"convert it: {command('convert', file, file.stem + target)}"
    mapped = command("convert", file, f"{file.stem}.h5", "--map", "map.toml")
    return f"convert it: {command('new', 'mapping', file, '--out', 'map.toml')}, then {mapped}"


def _target(file: Path) -> str:
    """Return the suffix into which a file is converted without a mapping; empty if it needs one."""
    try:
        with file.open("rb") as stream:
            text = stream.read(_EXAMINED).decode("latin-1")
    except OSError:
        return ".h5" if file.suffix.lower() in _EXCHANGED else ""
    if file.suffix.lower() in _EXCHANGED:
        return _target_of_uff(text)
    if file.suffix.lower() in _TEXT and _heads_places(text):
        return ".toml"
    return ""


def _target_of_uff(text: str) -> str:
    sets = re.findall(r"^ {4}-1[ \r]*\n {1,5}(\d+)b?[^\n]*\n(?=((?:[^\n]*\n){0,6}))", text, re.MULTILINE)
    kinds = {int(kind) for kind, _ in sets}
    functions = {int(head.split("\n")[5][:5]) for kind, head in sets if int(kind) == _FUNCTION and _is_whole(head)}
    if functions:
        return "" if functions == {_TIME} else ".h5"
    if kinds & set(_MODES):
        return ".json"
    return ".toml" if kinds & set(_GEOMETRY) else ".h5"


def _is_whole(head: str) -> bool:
    lines = head.split("\n")
    return len(lines) > 5 and lines[5][:5].strip().isdigit()


def _heads_places(text: str) -> bool:
    """Return whether the first line of a table heads the coordinates of points."""
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    names = [re.split(r"[\s(\[]", field.strip().lower())[0] for field in re.split(r"[,;\t]", first)]
    return {"x", "y", "z"} <= set(names)
