"""Layout of CSV files, and texts that a file holds besides its samples."""

import csv
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

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
    """Options of ``[csv]`` with which a file is read as a table of numbers; defaults are left out.

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
    options: dict[str, Any] = {}
    held = max(";\t", key=lines[head].count)
    usual = held if held in lines[head] or best.decimal == "," else ","
    if usual != best.delimiter and best.width > 1:
        options["delimiter"] = best.delimiter
    if best.decimal != ".":
        options["decimal"] = best.decimal
    if skipped:
        options["skip_lines"] = skipped
    return options if encoding == _ENCODINGS[0] else {**options, "encoding": encoding}


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


_NAMES = re.compile(
    r"name|label|channel|kanal|kan\u00e4le|kanaele|signal|sensor|bezeichn|column|spalte|head", re.IGNORECASE
)
_UNITS = re.compile(r"unit|einheit|unidad|eu$", re.IGNORECASE)
_DATES = re.compile(r"date|datum|recorded|start_?time|zeitstempel", re.IGNORECASE)
_LONGEST_TEXT, _MOST_NOTES, _FEW = 60, 24, 6
"""Characters of a text, notes, and numbers of an array that are shown in a mapping's first lines."""


@dataclass(frozen=True)
class ColumnTexts:
    """Names and units of an array's columns as other fields of its file state them.

    Parameters
    ----------
    names, units
        One text for each column; empty where the file states none, or more than one list might be meant.
    source
        Sentence on the fields that they come from; empty: none.
    """

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    source: str = ""


def column_texts(fields: Mapping[str, Any], array: str, count: int) -> ColumnTexts:
    """Names and units of the ``count`` columns of an array: lists of as many texts.

    A list of units is one by its field's name, or because most of its texts are units; any other may be names.

    Parameters
    ----------
    fields
        All that the file holds, by name.
    array
        Name of the array with the columns.
    count
        Number of its columns.
    """
    lists = _nearest({name: texts for name, value in fields.items() if len(texts := texts_of(value)) == count}, array)
    if count < 2:
        return ColumnTexts()
    units = {name: texts for name, texts in lists.items() if _are_units(name, texts)}
    rest = {name: texts for name, texts in lists.items() if name not in units and len(set(texts)) == count}
    unit, name = _only(units, _UNITS), _only(rest, _NAMES)
    sources = [f"{what} from {key}" for what, key in (("names", name), ("units", unit)) if key]
    return ColumnTexts(
        rest.get(name, ()),
        units.get(unit, ()),
        f"Columns of {array} have {' and '.join(sources)}: check them." if sources else "",
    )


def texts_of(value: Any) -> tuple[str, ...]:
    """Texts of a cell array or an array of characters; empty where a value is none."""
    if isinstance(value, str):
        return (value.strip(),)
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        return tuple(str(text).strip() for text in value.reshape(-1))
    return ()


def notes(fields: Mapping[str, Any]) -> Iterator[str]:
    """Short texts and few numbers that a file holds, each on a line: ``Hdr.machine: ABB IRB6660``."""
    lines = [f"  {name}: {shown}" for name, value in fields.items() if (shown := _shown(value))]
    yield from lines[:_MOST_NOTES]
    if len(lines) > _MOST_NOTES:
        yield f"  and {len(lines) - _MOST_NOTES} more"


def dates(fields: Mapping[str, Any]) -> str:
    """Texts of a file whose name says that they are a date or time, as ``Hdr.date = 2026-03-11``."""
    texts = [f"{name} = {_shown(value)}" for name, value in fields.items() if _DATES.search(name.rpartition(".")[2])]
    return ", ".join(text for text in texts if any(sign.isdigit() for sign in text.partition(" = ")[2]))


def _shown(value: Any) -> str:
    """One line for a few numbers or texts, empty for anything larger."""
    texts = texts_of(value)
    if texts:
        whole = " ".join(", ".join(texts).split())
        plain = "".join(sign if sign.isprintable() else "?" for sign in whole)
        return plain if len(plain) <= _LONGEST_TEXT * (1 + (len(texts) > 1)) else f"{plain[:_LONGEST_TEXT]} ..."
    if not isinstance(value, np.ndarray | np.generic | int | float) or not 0 < np.size(value) <= _FEW:
        return ""
    array = np.asarray(value)
    return ", ".join(f"{number:.10g}" for number in array.reshape(-1)) if array.dtype.kind in "iuf" else ""


def _nearest(lists: dict[str, tuple[str, ...]], array: str) -> dict[str, tuple[str, ...]]:
    """Lists in the array's own structure where there are some, else all."""
    own = {name: texts for name, texts in lists.items() if name.rpartition(".")[0] == array.rpartition(".")[0]}
    return own or lists


def _are_units(name: str, texts: tuple[str, ...]) -> bool:
    known = sum(bool(text) and is_unit(text.strip("[]()")) for text in texts)
    return bool(_UNITS.search(name.rpartition(".")[2])) or known > len(texts) / 2


def _only(lists: Mapping[str, tuple[str, ...]], wanted: re.Pattern[str]) -> str:
    """Name of the only list, or of the only list whose name states what it holds; empty: none, or not unique."""
    called = [name for name in lists if wanted.search(name.rpartition(".")[2])]
    names = called or list(lists)
    return names[0] if len(names) == 1 else ""
