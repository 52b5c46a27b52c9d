"""Data sets of Universal File Format files, read line by line or with pyuff."""

import contextlib
import io
import re
import warnings
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import FileFormatError, InputError

_MARK = re.compile(rb"    -1(?=[\r\n]| {74}|\Z)")  # line that opens and closes a data set, as pyuff searches for it
_DOS_TAIL = 16  # bytes
_NUMBERS_OF_LINE = 6  # most numbers in a line of a text function
_FUNCTION = 58  # number of the data set of a function
UFF_AXES = ("S", "X", "Y", "Z", "RX", "RY", "RZ")
"""Axes by their number in data set 58; a number below 0 reverses the direction."""


@dataclass(frozen=True)
class UffLines:
    """Lines of one data set, without its number and its first and last mark.

    Parameters
    ----------
    place
        Place of the data set in the file, counted from 1.
    kind
        Number of the data set.
    lines
        Lines of text in an 8-bit code page.
    """

    place: int
    kind: int
    lines: tuple[str, ...]


def read_uff_lines(path: Path, kinds: Collection[int]) -> tuple[UffLines, ...]:
    """Read the lines of all data sets of given kinds, for kinds that pyuff does not read correctly.

    Parameters
    ----------
    path, kinds
        Path of the file and numbers of the data sets, as in `read_uff_sets`.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No UFF file, or a file that is cut short.
    """
    data = _complete_bytes(path)
    marks = [mark.start() for mark in _MARK.finditer(data)]
    data_sets = []
    for place, (begin, end) in enumerate(zip(marks[::2], marks[1::2], strict=True), 1):
        head = data[begin : begin + 200].decode("latin-1").splitlines()  # 200 bytes hold the first two lines
        number = head[1][:6].strip() if len(head) > 1 else ""
        if number.isdigit() and int(number) in kinds:
            lines = data[begin:end].decode("latin-1").rstrip().replace("\r\n", "\n").split("\n")
            data_sets.append(UffLines(place, int(number), tuple(lines[2:])))
    return tuple(data_sets)


def uff_function_types(path: Path) -> set[int]:
    """Return the types of the functions (data set 58) of a UFF file, such as 1 for time records and 4 for FRFs."""
    types = set()
    data = _complete_bytes(path)
    for mark in list(_MARK.finditer(data))[::2]:
        lines = data[mark.start() : mark.start() + 800].decode("latin-1").splitlines()
        if len(lines) > 7 and lines[1][:6].strip() == str(_FUNCTION) and lines[7][:5].strip().isdigit():
            types.add(int(lines[7][:5]))
    return types


def _complete_bytes(path: Path) -> bytes:
    """Read a file whose data sets are all closed; raise an InputError or FileFormatError otherwise."""
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    data = path.read_bytes()
    if data[-_DOS_TAIL:].count(b"\x1a"):  # the byte by which DOS ends files, and what it left behind it
        data = data[: data.rindex(b"\x1a")]
    n_marks = len(_MARK.findall(data))
    if not n_marks and re.search(rb"^-1\s*$", data, re.MULTILINE):
        raise FileFormatError(
            f"{path}: its lines -1, which open and close the data sets, do not stand in columns 5 and 6, nor do its "
            "numbers in their columns, so that it is no file of the Universal File Format; export it from another "
            "program, or FRFs as text"
        )
    if not n_marks:
        raise FileFormatError(f"{path} holds no data set of the Universal File Format; give a file exported as UFF")
    if n_marks % 2 or not data.rstrip().endswith(b"-1"):
        raise FileFormatError(f"{path} is cut short: its last data set is not closed; export or copy it again")
    return data


def read_uff_sets(path: Path, kinds: Collection[int]) -> tuple[dict[str, Any], ...]:
    """Read all data sets of given kinds with pyuff, in the order of the file.

    pyuff reads a file as a whole, so that a single bad set of another kind would prevent the reading. It does not
    notice that a file is cut short, nor that a function (58) has fewer points than it announces. Here each set is read
    separately, and both are checked.

    Parameters
    ----------
    path
        File ``.uff`` or ``.unv``.
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
    _complete_bytes(path)
    import pyuff  # here, because it takes long to load

    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):  # pyuff prints what it does not know
        warnings.simplefilter("ignore")
        try:
            file = pyuff.UFF(str(path))
            all_kinds = [int(kind) for kind in file.get_set_types()]
        except Exception as error:  # damaged files make pyuff raise nearly anything
            raise FileFormatError(f"{path} is no readable UFF file ({_reason(error)}); export it again") from error
        functions = cache(lambda: {lines.place: lines for lines in read_uff_lines(path, (_FUNCTION,))})
        places = [(place, kind) for place, kind in enumerate(all_kinds, 1) if kind in kinds]
        return tuple(_read_set(path, file, place, kind, functions) for place, kind in places)


def _read_set(
    path: Path, file: Any, place: int, kind: int, functions: Callable[[], dict[int, UffLines]]
) -> dict[str, Any]:
    """Read one data set; ``functions`` returns the lines of all functions of the file by their place."""
    try:
        try:
            data_set = dict(file.read_sets(place - 1))
        except Exception:
            # pyuff fails at some numbers in text functions, which `_text_function` can read
            if kind != _FUNCTION:
                raise
            header = file.read_sets(place - 1, header_only=True)
            if header["binary"]:
                raise
            data_set = _text_function(functions()[place], header)
    except Exception as error:
        raise FileFormatError(
            f"{path}: data set {place} (type {kind}) cannot be read ({_reason(error)}); export it again"
        ) from error
    data_set["place"] = place
    if kind == _FUNCTION:
        _require_points(path, data_set)
    return data_set


def _text_function(function: UffLines, header: Mapping[str, Any]) -> dict[str, Any]:
    """Read a data set 58 in text: axis ``x`` and values ``data``, from its lines and the header that pyuff read."""
    # Data types: 2 and 4 are real, 5 and 6 complex; 4 and 6 have double precision.
    kind, is_even = int(header["ord_data_type"]), int(header["abscissa_spacing"])
    is_complex = kind in (5, 6)
    if is_even or kind in (2, 5):
        widths: tuple[int, ...] = {2: (13,) * 6, 5: (13,) * 6, 4: (20,) * 4, 6: (20,) * 4}[kind]
    else:  # the values of the axis have single precision
        widths = {4: (13, 20) * 2, 6: (13, 20, 20)}[kind]
    n_header = 11  # lines
    numbers = [number for line in function.lines[n_header:] for number in _numbers(line, widths)]
    n_columns = (2 if is_complex else 1) + (0 if is_even else 1)
    rows = np.array(numbers[: len(numbers) // n_columns * n_columns], dtype=float).reshape(-1, n_columns)
    values = rows if is_even else rows[:, 1:]
    x = header["abscissa_min"] + header["abscissa_inc"] * np.arange(len(rows)) if is_even else rows[:, 0]
    data = values[:, 0] + 1j * values[:, 1] if is_complex else values[:, 0]
    return {**header, "x": x, "data": data}


def _numbers(line: str, widths: tuple[int, ...]) -> list[float]:
    """Read the numbers of a line in fields of fixed width, also with the exponent sign D of Fortran."""
    text = line.rstrip().replace("D", "E").replace("d", "e")
    starts = np.cumsum((0, *widths[:-1]))
    return [float(text[at : at + width]) for at, width in zip(starts, widths, strict=True) if at < len(text)]


def _require_points(path: Path, function: dict[str, Any]) -> None:
    """Refuse a function with another number of points than it announces; cut what fills the last line of a text."""
    announced, n_points = int(function["num_pts"]), len(function["data"])
    line_end = 2 if function["binary"] else 0  # pyuff counts the line's end as up to two numbers of binary data
    excess = np.asarray(function["data"])[announced:]
    is_padding = not function["binary"] and len(excess) < _NUMBERS_OF_LINE and not excess.any()
    if not announced <= n_points <= announced + line_end and not (is_padding and n_points > announced):
        raise FileFormatError(
            f"{path}: data set {function['place']} announces {announced} points and holds {n_points}; it is damaged, "
            "export it again"
        )
    function["data"] = np.asarray(function["data"])[:announced]
    function["x"] = np.asarray(function["x"], dtype=float)[:announced]


def _reason(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__
