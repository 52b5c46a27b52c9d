"""`seen_csv_options`: how a CSV file of another program is written, as far as its rows tell it."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from millfrf.core import SI_UNITS, InputError, si_factor

_ENCODINGS = ("utf-8-sig", "cp1252")
_OTHER_UNITS = (
    "",
    "-",
    "NaN",
    "nan",
    "n/a",
    "s",
    "ms",
    "us",
    "µs",
    "Hz",
    "A",
    "mA",
    "°C",
    "degC",
    "1/min",
    "pC",
    "bar",
)
_LOOKED_AT = 400
"""Rows at the end of the file that show how numbers are written; a preamble is shorter than the samples."""


@dataclass(frozen=True)
class _Writing:
    """A delimiter and a decimal sign, and the rows of numbers at the end of the file that they make."""

    delimiter: str
    decimal: str
    first: int
    width: int


def seen_csv_options(path: Path) -> dict[str, Any]:
    """Options of ``[csv]`` with which a file is a table of numbers; those that need not be said are left out.

    Numbers are read from the last row upwards. The line above them may hold units, the one above that headings; what
    stands before is a preamble, whose lines are counted as ``skip_lines``.

    Parameters
    ----------
    path
        Text file with columns of numbers.

    Raises
    ------
    InputError
        No such file, or no delimiter and decimal sign make its last row one of numbers.
    """
    text, encoding = _text(path)
    lines = text.splitlines()
    kept = [k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    ways = [way for delimiter in ";\t," for decimal in ".," if (way := _tried(lines, kept, delimiter, decimal))]
    if not ways:
        raise InputError(
            f"{path}: its last row is not one of numbers with comma, semicolon or tabulator between them; export it as "
            "CSV, or write a mapping with [csv]"
        )
    best = max(ways, key=lambda way: (-way.first, way.width, way.decimal == "."))
    head = _head(lines, kept, best)
    skipped = head if kept.index(head) > 0 else 0
    found: dict[str, Any] = {}
    held = max(";\t", key=lines[head].count)
    usual = held if held in lines[head] or best.decimal == "," else ","
    if usual != best.delimiter and best.width > 1:
        found["delimiter"] = best.delimiter
    if best.decimal != ".":
        found["decimal"] = best.decimal
    if skipped:
        found["skip_lines"] = skipped
    return found if encoding == _ENCODINGS[0] else {**found, "encoding": encoding}


def _text(path: Path) -> tuple[str, str]:
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    for encoding in _ENCODINGS:
        try:
            return path.read_text(encoding=encoding), encoding
        except UnicodeDecodeError:
            continue
    raise InputError(f"{path} is no text in UTF-8 or Windows-1252; save it as UTF-8")


def _tried(lines: list[str], kept: list[int], delimiter: str, decimal: str) -> _Writing | None:
    """Rows of numbers from the last one upwards; None where the last row is none, or the signs are the same."""
    if delimiter == decimal or not kept:
        return None
    width = len(cells_of(lines[kept[-1]], delimiter))
    first = None
    for number in reversed(kept[-_LOOKED_AT:]):
        cells = cells_of(lines[number], delimiter)
        if len(cells) != width or not all(_is_number(cell, decimal) for cell in cells):
            break
        first = number
    if first is None:
        return None
    return _Writing(delimiter, decimal, _first_of_table(lines, kept, delimiter, decimal, first), width)


def _first_of_table(lines: list[str], kept: list[int], delimiter: str, decimal: str, first: int) -> int:
    """Number of the first line whose cells are as many as those of the rows, and of which one is a number."""
    width = len(cells_of(lines[first], delimiter))
    for number in reversed(kept[: kept.index(first)]):
        cells = cells_of(lines[number], delimiter)
        if len(cells) != width or not any(_is_number(cell, decimal) for cell in cells):
            break
        first = number
    return first


def _head(lines: list[str], kept: list[int], way: _Writing) -> int:
    """Number of the line of headings: above the numbers, or above their units; else that of the first numbers."""
    place = kept.index(way.first)
    above = kept[max(0, place - 2) : place]
    cells = [cells_of(lines[number], way.delimiter) for number in above]
    if not above or len(cells[-1]) != way.width:
        return way.first
    if len(above) == 2 and len(cells[0]) == way.width and not _are_headings(cells[-1]):
        return above[0]
    return above[-1]


def _are_headings(cells: list[str]) -> bool:
    """Whether the lowest row of texts is headings: most of its cells are neither units nor missing."""
    return sum(not is_unit(cell.strip("[]()")) for cell in cells) > len(cells) / 2


def is_unit(cell: str) -> bool:
    """Whether a text is a unit, or stands for none or a missing one."""
    return cell in _OTHER_UNITS or any(_fits(quantity, cell) for quantity in SI_UNITS)


def _fits(quantity: str, cell: str) -> bool:
    try:
        si_factor(quantity, cell)
    except InputError:
        return False
    return True


def cells_of(line: str, delimiter: str) -> list[str]:
    """Cells of a line, without the blanks around them."""
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter))]


def _is_number(cell: str, decimal: str) -> bool:
    try:
        float(cell.replace(".", "x").replace(decimal, ".") if decimal != "." else cell)
    except ValueError:
        return False
    return True
