"""Data sets of Universal File Format files, read line by line or with pyuff."""

import contextlib
import io
import re
import warnings
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import FileFormatError, InputError

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


_HEADER = 11
_WIDTHS = {
    (2, 1): (13,) * 6,
    (5, 1): (13,) * 6,
    (2, 0): (13,) * 6,
    (5, 0): (13,) * 6,
    (4, 1): (20,) * 4,
    (6, 1): (20,) * 4,
    (4, 0): (13, 20) * 2,
    (6, 0): (13, 20, 20),
}
"""Widths of a line's fields, by data type (real or complex, single or double) and by whether the axis is even."""

_COMPLEX = (5, 6)


def text_function(one: UffLines, header: Mapping[str, Any]) -> dict[str, Any]:
    """A data set with its axis ``x`` and values ``data``, from its lines.

    Parameters
    ----------
    one
        Lines of a data set 58 in text.
    header
        What pyuff read of it.

    Raises
    ------
    ValueError, KeyError
        A field that is no number, or a data type that the format does not have.
    """
    kind, even = int(header["ord_data_type"]), int(header["abscissa_spacing"])
    widths = _WIDTHS[kind, even]
    numbers = [number for line in one.lines[_HEADER:] for number in _fields(line, widths)]
    columns = (2 if kind in _COMPLEX else 1) + (0 if even else 1)
    rows = np.array(numbers[: len(numbers) // columns * columns], dtype=float).reshape(-1, columns)
    values = rows if even else rows[:, 1:]
    x = header["abscissa_min"] + header["abscissa_inc"] * np.arange(len(rows)) if even else rows[:, 0]
    data = values[:, 0] + 1j * values[:, 1] if kind in _COMPLEX else values[:, 0]
    return {**header, "x": x, "data": data}


def _fields(line: str, widths: tuple[int, ...]) -> list[float]:
    text, at, found = line.rstrip().replace("D", "E").replace("d", "e"), 0, []
    for width in widths:
        if at >= len(text):
            break
        found.append(float(text[at : at + width]))
        at += width
    return found


_FUNCTION = 58
_SPARE = 2
"""Numbers by which a binary data set may be longer than announced: line ends are counted with the data."""


def read_uff_sets(path: Path, kinds: Collection[int]) -> tuple[dict[str, Any], ...]:
    """All data sets of the kinds asked for, in the order of the file, as pyuff gives them; others are passed over.

    pyuff reads a file whole or not at all, so that one set of a kind that nobody asked for would spoil the rest; it
    does not see that a file is cut short, nor that a function (58) has fewer points than it announces. Here each set is
    read for itself, and these are looked at. pyuff prints what it does not know; nothing of that is let through.

    Parameters
    ----------
    path
        ``.uff`` or ``.unv``.
    kinds
        Numbers of data sets, such as 58 (functions; 58b is one of them) or 2411 (nodes).

    Returns
    -------
    tuple of dict
        Each with its ``type`` and, for messages, its ``place`` in the file, counted from 1.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No UFF file, a file that is cut short, or a data set that cannot be read or lacks points.
    """
    whole_uff(path)
    import pyuff

    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        try:
            file = pyuff.UFF(str(path))
            found = [int(kind) for kind in file.get_set_types()]
        except Exception as error:  # whatever a damaged file brings pyuff to
            raise FileFormatError(f"{path} is no readable UFF file ({_reason(error)}); export it again") from error
        lines: dict[int, UffLines] = {}
        return tuple(_one(path, file, place, kind, lines) for place, kind in enumerate(found, 1) if kind in kinds)


def _one(path: Path, file: Any, place: int, kind: int, lines: dict[int, UffLines]) -> dict[str, Any]:
    try:
        found = _as_pyuff_reads(path, file, place, kind, lines)
    except Exception as error:
        raise FileFormatError(
            f"{path}: data set {place} (type {kind}) cannot be read ({_reason(error)}); export it again"
        ) from error
    found["place"] = place
    if kind == _FUNCTION:
        _require_points(path, found)
    return dict(found)


def _as_pyuff_reads(path: Path, file: Any, place: int, kind: int, lines: dict[int, UffLines]) -> dict[str, Any]:
    """The set as pyuff reads it; where it stumbles over the numbers of a text function, these are read here.

    ``lines`` keeps those of all functions of the file, from the first time that they are needed.
    """
    try:
        return dict(file.read_sets(place - 1))
    except Exception:
        if kind != _FUNCTION:
            raise
        header = file.read_sets(place - 1, header_only=True)
        if header["binary"]:
            raise
        if not lines:
            lines |= {one.place: one for one in read_uff_lines(path, (_FUNCTION,))}
        return text_function(lines[place], header)


def _require_points(path: Path, found: dict[str, Any]) -> None:
    """As many points as the header says; what binary data hold beyond is the line's end."""
    announced, held = int(found["num_pts"]), len(found["data"])
    if held < announced or held > announced + (_SPARE if found["binary"] else 0):
        raise FileFormatError(
            f"{path}: data set {found['place']} announces {announced} points and holds {held}; it is damaged, export "
            "it again"
        )
    found["data"] = np.asarray(found["data"])[:announced]
    found["x"] = np.asarray(found["x"], dtype=float)[:announced]


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
