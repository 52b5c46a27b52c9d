"""Detection of the format of CSV files, and of texts in files with samples."""

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
_LAST_ROWS = 400  # rows from which the format is detected; a preamble is shorter than the samples


@dataclass(frozen=True)
class _CsvFormat:
    """Delimiter and decimal sign of a CSV file, with the first row and the number of columns of the resulting table."""

    delimiter: str
    decimal: str
    first: int
    width: int


def seen_csv_options(path: Path) -> dict[str, Any]:
    """Detect the options of the table ``[csv]`` for a file; leave out options with their default.

    Numbers are read from the last row upwards. The line above the numbers may contain units, the line above the units
    headings; earlier lines are a preamble (``skip_lines``).
    """
    text, encoding = _text(path)
    lines = text.splitlines()
    rows = [k for k, line in enumerate(lines) if line.strip() and not line.startswith("#")]
    formats = [
        csv_format
        for delimiter in ";\t,"
        for decimal in ".,"
        if (csv_format := _csv_format(lines, rows, delimiter, decimal))
    ]
    if not formats:
        raise InputError(
            f"{path}: its last row does not consist of numbers with commas, semicolons or tabulators; export it as "
            "CSV, or write a mapping with [csv]"
        )
    best = max(formats, key=lambda csv_format: (-csv_format.first, csv_format.width, csv_format.decimal == "."))
    header = _header_line(lines, rows, best)
    skip_lines = header if rows.index(header) > 0 else 0
    options: dict[str, Any] = {}
    expected = max(";\t", key=lines[header].count)
    default_delimiter = expected if expected in lines[header] or best.decimal == "," else ","
    if default_delimiter != best.delimiter and best.width > 1:
        options["delimiter"] = best.delimiter
    if best.decimal != ".":
        options["decimal"] = best.decimal
    if skip_lines:
        options["skip_lines"] = skip_lines
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


def _csv_format(lines: list[str], rows: list[int], delimiter: str, decimal: str) -> _CsvFormat | None:
    """Read rows of numbers from the last row upwards; return None if the last row contains no numbers."""
    if delimiter == decimal or not rows:
        return None
    width = len(cells_of(lines[rows[-1]], delimiter))
    first = None
    for number in reversed(rows[-_LAST_ROWS:]):
        cells = cells_of(lines[number], delimiter)
        if len(cells) != width or not all(_is_number(cell, decimal) for cell in cells):
            break
        first = number
    if first is None:
        return None
    return _CsvFormat(delimiter, decimal, _first_of_table(lines, rows, delimiter, decimal, first), width)


def _first_of_table(lines: list[str], rows: list[int], delimiter: str, decimal: str, first: int) -> int:
    """Return the first line of the table: all lines from it on have equally many cells and at least one number."""
    width = len(cells_of(lines[first], delimiter))
    for number in reversed(rows[: rows.index(first)]):
        cells = cells_of(lines[number], delimiter)
        if len(cells) != width or not any(_is_number(cell, decimal) for cell in cells):
            break
        first = number
    return first


def _header_line(lines: list[str], rows: list[int], csv_format: _CsvFormat) -> int:
    """Return the line of headings, above the numbers or their units; without headings, the first line of numbers."""
    place = rows.index(csv_format.first)
    above = rows[max(0, place - 2) : place]
    cells = [cells_of(lines[number], csv_format.delimiter) for number in above]
    if not above or len(cells[-1]) != csv_format.width:
        return csv_format.first
    if len(above) == 2 and len(cells[0]) == csv_format.width and not _are_headings(cells[-1]):
        return above[0]
    return above[-1]


def _are_headings(cells: list[str]) -> bool:
    """Return whether most cells are neither units nor empty."""
    return sum(not is_unit(cell.strip("[]()")) for cell in cells) > len(cells) / 2


def is_unit(cell: str) -> bool:
    """Return whether a text is a unit or a mark of a missing unit."""
    return cell in _OTHER_UNITS or any(_fits(quantity, cell) for quantity in SI_UNITS)


def _fits(quantity: str, cell: str) -> bool:
    try:
        si_factor(quantity, cell)
    except InputError:
        return False
    return True


def cells_of(line: str, delimiter: str) -> list[str]:
    """Split a line into cells without surrounding blanks."""
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
_PATHS = re.compile(r"path|pfad", re.IGNORECASE)
_UNITS = re.compile(r"unit|einheit|unidad|eu$", re.IGNORECASE)
_DATES = re.compile(r"date|datum|recorded|start_?time|zeitstempel", re.IGNORECASE)
# limits of the comments in a mapping: characters of a text, notes, numbers of an array
_LONGEST_TEXT, _MOST_NOTES, _MOST_NUMBERS = 60, 24, 6


@dataclass(frozen=True)
class ColumnTexts:
    """Names and units of the columns of an array, from other fields of the file."""

    names: tuple[str, ...] = ()  # one for each column; empty: none or ambiguous
    units: tuple[str, ...] = ()  # likewise
    source: str = ""  # sentence on the fields that were used


def column_texts(fields: Mapping[str, Any], array: str, count: int) -> ColumnTexts:
    """Find names and units of the ``count`` columns of an array in lists of ``count`` texts.

    A list contains units if its name says so or if most of its texts are units; any other list may be names.
    """
    lists = _nearest({name: texts for name, value in fields.items() if len(texts := texts_of(value)) == count}, array)
    if count < 2:
        return ColumnTexts()
    units = {name: texts for name, texts in lists.items() if _are_units(name, texts)}
    other_texts = {name: texts for name, texts in lists.items() if name not in units and len(set(texts)) == count}
    unit, name = _only(units, _UNITS), _only(other_texts, _NAMES)
    sources = [f"{what} from {key}" for what, key in (("names", name), ("units", unit)) if key]
    return ColumnTexts(
        other_texts.get(name, ()),
        units.get(unit, ()),
        f"Columns of {array} have {' and '.join(sources)}: check them." if sources else "",
    )


def member_texts(fields: Mapping[str, Any], array: str) -> tuple[str, str]:
    """Return name and unit that a structure states for its only array of numbers, such as ``Y(2).Data``; empty: none.

    A name with slashes is the path of a signal, of which the last part is taken.
    """
    place = array.rpartition(".")[0]
    beside = {name: value for name, value in fields.items() if place and name.rpartition(".")[0] == place}
    if sum(isinstance(value, np.ndarray) and value.dtype.kind in "iufb" for value in beside.values()) > 1:
        return "", ""
    texts = {name: found[0] for name, value in beside.items() if len(found := texts_of(value)) == 1 and found[0]}
    names = [name for pattern in (_NAMES, _PATHS) for name in texts if pattern.search(name.rpartition(".")[2])]
    units = [name for name in texts if _UNITS.search(name.rpartition(".")[2])]
    return texts[names[0]].rstrip("/").rpartition("/")[2] if names else "", texts[units[0]] if units else ""


def texts_of(value: Any) -> tuple[str, ...]:
    """Return the texts of a cell array or an array of characters; return no texts for other values."""
    if isinstance(value, str):
        return (value.strip(),)
    if isinstance(value, np.ndarray) and value.dtype.kind == "U":
        return tuple(str(text).strip() for text in value.reshape(-1))
    return ()


def notes(fields: Mapping[str, Any]) -> Iterator[str]:
    """Yield short texts and small arrays of a file, each on a line: ``Hdr.machine: ABB IRB6660``."""
    lines = [f"  {name}: {shown}" for name, value in fields.items() if (shown := _shown(value))]
    yield from lines[:_MOST_NOTES]
    if len(lines) > _MOST_NOTES:
        yield f"  and {len(lines) - _MOST_NOTES} more"


def dates(fields: Mapping[str, Any]) -> str:
    """Return the texts with the name of a date or time, as ``Hdr.date = 2026-03-11``."""
    texts = [f"{name} = {_shown(value)}" for name, value in fields.items() if _DATES.search(name.rpartition(".")[2])]
    return ", ".join(text for text in texts if any(sign.isdigit() for sign in text.partition(" = ")[2]))


def _shown(value: Any) -> str:
    """Format a few numbers or texts in one line; empty for larger values."""
    texts = texts_of(value)
    if texts:
        joined = " ".join(", ".join(texts).split())
        plain = "".join(sign if sign.isprintable() else "?" for sign in joined)
        return plain if len(plain) <= _LONGEST_TEXT * (1 + (len(texts) > 1)) else f"{plain[:_LONGEST_TEXT]} ..."
    if not isinstance(value, np.ndarray | np.generic | int | float) or not 0 < np.size(value) <= _MOST_NUMBERS:
        return ""
    array = np.asarray(value)
    return ", ".join(f"{number:.10g}" for number in array.reshape(-1)) if array.dtype.kind in "iuf" else ""


def _nearest(lists: dict[str, tuple[str, ...]], array: str) -> dict[str, tuple[str, ...]]:
    """Return the lists that are in the same structure as the array; if there are none, return all lists."""
    in_structure = {name: texts for name, texts in lists.items() if name.rpartition(".")[0] == array.rpartition(".")[0]}
    return in_structure or lists


def _are_units(name: str, texts: tuple[str, ...]) -> bool:
    n_units = sum(bool(text) and is_unit(text.strip("[]()")) for text in texts)
    return bool(_UNITS.search(name.rpartition(".")[2])) or n_units > len(texts) / 2


def _only(lists: Mapping[str, tuple[str, ...]], pattern: re.Pattern[str]) -> str:
    """Return the name of the list whose name matches, or of the only list; empty if none or several fit."""
    matching = [name for name in lists if pattern.search(name.rpartition(".")[2])]
    names = matching or list(lists)
    return names[0] if len(names) == 1 else ""
