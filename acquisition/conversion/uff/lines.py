"""Lines of the data sets of a Universal File Format file, as they stand."""

import re
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path

from foundation import FileFormatError, InputError

_MARK = re.compile(rb"    -1(?=[\r\n]| {74}|\Z)")
"""Line that opens and closes a data set, as pyuff looks for it."""

_HEAD = 200  # bytes that hold the first two lines of a data set


@dataclass(frozen=True)
class UffLines:
    """The lines of one data set as they stand, without those of its number and of its ends.

    Parameters
    ----------
    place
        Place of the data set in the file, counted from 1.
    kind
        Number of the data set.
    lines
        Lines of text of an 8-bit code page.
    """

    place: int
    kind: int
    lines: tuple[str, ...]


def read_uff_lines(path: Path, kinds: Collection[int]) -> tuple[UffLines, ...]:
    """Read the lines of all data sets of given kinds: of those that pyuff does not read, or reads wrongly.

    Parameters
    ----------
    path, kinds
        Path of the file and numbers of the data sets, as in `read_uff_sets`.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No UFF file, or one that is cut short.
    """
    data = whole_uff(path)
    at = [mark.start() for mark in _MARK.finditer(data)]
    found = []
    for place, (begin, end) in enumerate(zip(at[::2], at[1::2], strict=True), 1):
        head = data[begin : begin + _HEAD].decode("latin-1").splitlines()
        number = head[1][:6].strip() if len(head) > 1 else ""
        if number.isdigit() and int(number) in kinds:
            lines = data[begin:end].decode("latin-1").rstrip().replace("\r\n", "\n").split("\n")
            found.append(UffLines(place, int(number), tuple(lines[2:])))
    return tuple(found)


def whole_uff(path: Path) -> bytes:
    """The file's bytes; data sets begin and end with a line ``    -1``.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No data set inside, or one that is not closed.
    """
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    data = path.read_bytes()
    marks = len(_MARK.findall(data))
    if not marks:
        raise FileFormatError(f"{path} holds no data set of the Universal File Format; give a file exported as UFF")
    if marks % 2 or not data.rstrip().endswith(b"-1"):
        raise FileFormatError(f"{path} is cut short: its last data set is not closed; export or copy it again")
    return data
