"""Text exports of analysers: lines of header, then columns of numbers; gzip too."""

import gzip
import io
import warnings
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError

from .frf_mapping import TextOptions

SUFFIXES = (".csv", ".txt", ".asc", ".dat", ".tsv", ".gz")

_BLANKS = "blanks"
_DELIMITERS = ("\t", ";", ",", _BLANKS)
_FREQUENCY_UNITS = ("hz", "khz", "rad/s", "[hz]", "(hz)")
_LARGEST = 2_000_000_000
_CODE_PAGES = ("utf-8-sig", "cp1252", "latin-1")
_SHOWN = 40


@dataclass(frozen=True)
class TextTable:
    """Columns of numbers below a header.

    Parameters
    ----------
    path
        Path of the file.
    headings, units
        Heading and unit of each column; empty texts where the header says none.
    values : (n_rows, n_columns)
        Numbers of the table.
    """

    path: Path
    headings: tuple[str, ...]
    units: tuple[str, ...]
    values: NDArray[np.float64]


def read_text_table(path: Path, options: TextOptions | None = None) -> TextTable:
    """Read a table of numbers with whatever header it has; delimiter, decimal sign and code page are found.

    Parameters
    ----------
    path
        Text, or text packed with gzip (``.gz``).
    options
        Options of the text that cannot be found in it, or are found wrongly: delimiter, decimal sign, header.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No rows of two or more numbers, a row that is not like the others, or a damaged gzip file.
    """
    options = options or TextOptions()
    lines = [line.rstrip() for line in _text(path, options.encoding).splitlines()][options.skip_lines :]
    while lines and not lines[-1]:
        lines.pop()
    delimiter, decimal, first = _layout(path, lines, options)
    rows = [_fields(line, delimiter) for line in lines[first : first + 1]]
    width = len(rows[0])
    values = _numbers(path, lines[first:], delimiter, decimal, width, first + options.skip_lines)
    headings, units = _header([_fields(line.lstrip("#%! "), delimiter) for line in lines[:first]], width)
    return TextTable(path, headings, units, values)


def _text(path: Path, encoding: str | None) -> str:
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        data = path.read_bytes()
        if path.suffix.lower() == ".gz" or data[:2] == b"\x1f\x8b":
            with gzip.open(io.BytesIO(data)) as packed:
                data = packed.read(_LARGEST)
    except (OSError, EOFError, zlib.error) as error:
        raise FileFormatError(f"{path} is damaged or cut short ({error}); copy or export it again") from error
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        encoding = encoding or "utf-16"
    for code_page in (encoding,) if encoding else _CODE_PAGES:
        try:
            return data.decode(code_page)
        except (UnicodeDecodeError, LookupError):
            continue
    raise FileFormatError(f"{path} is not text of encoding {encoding}; set encoding under [csv], such as cp1252")


def _layout(path: Path, lines: Sequence[str], options: TextOptions) -> tuple[str, str, int]:
    """Delimiter, decimal sign and number of the first row, by which the last line is a row of two or more numbers."""
    delimiters = (options.delimiter,) if options.delimiter else _DELIMITERS
    decimals = (options.decimal,) if options.decimal else (".", ",")
    for decimal in decimals:
        for delimiter in delimiters:
            if delimiter == decimal or not lines or not _is_row(lines[-1], delimiter, decimal):
                continue
            width = len(_fields(lines[-1], delimiter))
            first = len(lines)
            while first and _is_row(lines[first - 1], delimiter, decimal, width):
                first -= 1
            _require_only_header(path, lines, first, delimiter, decimal, options.skip_lines)
            return delimiter, decimal, first
    last = repr(lines[-1][:_SHOWN]) if lines else "empty"
    raise FileFormatError(
        f"{path} does not end in rows of two or more numbers (its last line is {last}); export a table, or set "
        "delimiter and decimal under [csv]"
    )


def _require_only_header(
    path: Path, lines: Sequence[str], first: int, delimiter: str, decimal: str, skipped: int
) -> None:
    """What stands above the rows must be a header: a line among the rows that is none of them ended the search."""
    above = lines[first - 1] if first else ""
    width = len(_fields(lines[first], delimiter))
    if _is_row(above, delimiter, decimal) and first == len(lines) - 1:
        raise FileFormatError(
            f"{path} ends in a line of {width} columns where the line above has {len(_fields(above, delimiter))}: it "
            "is cut short, export it again"
        )
    if any(_is_row(line, delimiter, decimal, width) for line in lines[:first]) or _is_row(above, delimiter, decimal):
        raise FileFormatError(
            f"{path}: line {first + skipped} ({above[:_SHOWN]!r}) is not like the rows below it; mend the file, or set "
            "skip_lines under [csv]"
        )


def _fields(line: str, delimiter: str) -> list[str]:
    fields = line.split() if delimiter == _BLANKS else [field.strip() for field in line.split(delimiter)]
    return fields[:-1] if len(fields) > 1 and not fields[-1] else fields


def _is_row(line: str, delimiter: str, decimal: str, width: int | None = None) -> bool:
    fields = _fields(line, delimiter)
    if len(fields) < 2 or width not in (None, len(fields)):
        return False
    return all(_is_number(field, decimal) for field in fields)


def _is_number(field: str, decimal: str) -> bool:
    try:
        float(field.replace(decimal, ".") if decimal != "." else field)
    except ValueError:
        return False
    return True


def _numbers(
    path: Path, lines: Sequence[str], delimiter: str, decimal: str, width: int, above: int
) -> NDArray[np.float64]:
    """All rows, (n_rows, width)."""
    text = "\n".join(lines) if decimal == "." else "\n".join(lines).replace(decimal, ".")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.loadtxt(
                io.StringIO(text), delimiter=None if delimiter == _BLANKS else delimiter, ndmin=2, comments=None,
                usecols=range(width),
            )  # fmt: skip
        except (ValueError, Warning) as error:
            raise FileFormatError(f"{path}: the rows from line {above + 1} on cannot be read; mend the file") from error


def _header(rows: Sequence[Sequence[str]], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Headings and units of the columns, from the lines above them that are as wide, the nearest first."""
    headings: tuple[str, ...] = ("",) * width
    units: tuple[str, ...] = ("",) * width
    for row in reversed(rows):
        filled = tuple(field.strip('"') for field in row) + ("",) * (width - len(row))
        if not 2 <= len(row) <= width or not filled[0]:
            continue
        if filled[0].lower() in _FREQUENCY_UNITS:
            units = filled
        elif len(row) == width:
            headings = filled
            break
    units = tuple(unit or unit_in(heading) for unit, heading in zip(units, headings, strict=True))
    return headings, tuple(unit.strip() for unit in units)


def unit_in(heading: str) -> str:
    """What stands in the last pair of brackets at the end of a heading; empty where there is none.

    Examples
    --------
    >>> unit_in("Re(H) ((m/s²)/N)"), unit_in("Phase [deg]"), unit_in("Coherence")
    ('(m/s²)/N', 'deg', '')
    """
    text, depth = heading.strip(), 0
    for place in range(len(text) - 1, -1, -1):
        depth += (text[place] in ")]") - (text[place] in "([")
        if depth == 0:
            return text[place + 1 : -1] if place < len(text) - 1 else ""
    return ""
