"""Text exports of analysers: lines of header, then columns of numbers; also packed with gzip."""

import gzip
import io
import re
import warnings
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from millfrf.core import FileFormatError, InputError, Real

from .frf_mapping import TextOptions

SUFFIXES = (".csv", ".txt", ".asc", ".dat", ".tsv", ".gz")

_BLANKS = "blanks"
_FREQUENCY_UNITS = ("hz", "khz", "rad/s", "[hz]", "(hz)")
_LARGEST = 2_000_000_000  # bytes of an unpacked file: a small damaged or hostile one may unpack to any size
_SHOWN = 40  # characters of a line in a message


@dataclass(frozen=True)
class TextTable:
    """Columns of numbers below a header; headings and units are empty texts where the header has none."""

    path: Path
    headings: tuple[str, ...]
    units: tuple[str, ...]
    values: Real  # (n_rows, n_columns)

    def column(self, place: int | str, part: str) -> int:
        """Return the index of a column, from 0, by its number from 1 or its heading; ``part`` is for messages."""
        if isinstance(place, int) and place <= len(self.headings):
            return place - 1
        same = [k for k, heading in enumerate(self.headings) if heading == place]
        if len(same) == 1:
            return same[0]
        raise InputError(f"{self.path}: {part} = {place!r} is no column of it; it has {self.columns_text()}")

    def columns_text(self) -> str:
        """List the columns by number, heading and unit: ``1 Frequency (Hz), 2 Real``."""
        columns = []
        for number, (heading, unit) in enumerate(zip(self.headings, self.units, strict=True), 1):
            bracket = f"({unit})" if unit and unit not in heading else ""
            columns.append(" ".join(filter(None, (str(number), heading, bracket))))
        return ", ".join(columns)


def read_text_table(path: Path, options: TextOptions | None = None) -> TextTable:
    """Read a table of numbers below any header.

    Delimiter, decimal sign and encoding are recognised unless the options state them.

    A file without rows of two or more numbers, a row that differs from the others, and a damaged gzip file raise a
    FileFormatError.
    """
    options = options or TextOptions()
    lines = [line.rstrip() for line in _text(path, options.encoding).splitlines()][options.skip_lines :]
    while lines and not lines[-1]:
        lines.pop()
    delimiter, decimal, first = _layout(path, lines, options)
    width = len(_fields(lines[first], delimiter))
    values = _numbers(path, lines[first:], delimiter, decimal, width, first + options.skip_lines)
    headings, units = _header([_fields(line.lstrip("#%! "), delimiter) for line in lines[:first]], width)
    return TextTable(path, headings, units, values)


def _text(path: Path, encoding: str | None) -> str:
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        data = path.read_bytes()
        if path.suffix.lower() == ".gz" or data[:2] == b"\x1f\x8b":  # the signature of gzip
            with gzip.open(io.BytesIO(data)) as packed:
                data = packed.read(_LARGEST)
    except (OSError, EOFError, zlib.error) as error:
        raise FileFormatError(f"{path} is damaged or cut short ({error}); copy or export it again") from error
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):  # byte order marks
        encoding = encoding or "utf-16"
    # latin-1 decodes any bytes, so that it is the last
    for code_page in (encoding,) if encoding else ("utf-8-sig", "cp1252", "latin-1"):
        try:
            return data.decode(code_page)
        except (UnicodeDecodeError, LookupError):
            continue
    raise FileFormatError(f"{path} is not text of encoding {encoding}; set encoding under [csv], such as cp1252")


def _layout(path: Path, lines: Sequence[str], options: TextOptions) -> tuple[str, str, int]:
    """Find delimiter, decimal sign and first row, such that the last line is a row of two or more numbers.

    The search runs from the end, because headers differ and may hold numbers.
    """
    for decimal in (options.decimal,) if options.decimal else (".", ","):
        for delimiter in (options.delimiter,) if options.delimiter else ("\t", ";", ",", _BLANKS):
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
    """Refuse rows of numbers above the first row: a damaged line among the rows has ended the search too early."""
    above = lines[first - 1] if first else ""
    width = len(_fields(lines[first], delimiter))
    if _is_row(above, delimiter, decimal) and first == len(lines) - 1:
        raise FileFormatError(
            f"{path} ends in a line of {width} columns where the line above has {len(_fields(above, delimiter))}: it "
            "is cut short, export it again"
        )
    if any(_is_row(line, delimiter, decimal, width) for line in lines[:first]) or _is_row(above, delimiter, decimal):
        raise FileFormatError(
            f"{path}: line {first + skipped} ({above[:_SHOWN]!r}) is not like the rows below it; correct the file, or "
            "set skip_lines under [csv]"
        )


def _fields(line: str, delimiter: str) -> list[str]:
    fields = line.split() if delimiter == _BLANKS else [field.strip() for field in line.split(delimiter)]
    return fields[:-1] if len(fields) > 1 and not fields[-1] else fields  # some programs end lines with a delimiter


def _is_row(line: str, delimiter: str, decimal: str, width: int | None = None) -> bool:
    fields = _fields(line, delimiter)
    if len(fields) < 2 or width not in (None, len(fields)):
        return False
    return all(_is_number(field, decimal) for field in fields)


def _is_number(field: str, decimal: str) -> bool:
    try:
        float(field.replace(decimal, "."))
    except ValueError:
        return False
    return True


def _numbers(path: Path, lines: Sequence[str], delimiter: str, decimal: str, width: int, above: int) -> Real:
    """Return all rows, (n_rows, width)."""
    text = io.StringIO("\n".join(lines).replace(decimal, "."))
    separator = None if delimiter == _BLANKS else delimiter
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.loadtxt(text, delimiter=separator, ndmin=2, comments=None, usecols=range(width))
        except (ValueError, Warning) as error:
            raise FileFormatError(
                f"{path}: the rows from line {above + 1} on cannot be read; correct the file"
            ) from error


def _header(rows: Sequence[Sequence[str]], width: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return headings and units of the columns, from the nearest lines above them with as many fields."""
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
    """Return the text in the last pair of brackets at the end of a heading; empty where there is none.

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


# words of headings, in English and German
_ROLES = {
    "frequency": r"freq\w*",
    "real": r"re|real\w*",
    "imaginary": r"im|imag\w*",
    "magnitude": r"mag\w*|amp\w*|abs|absolute|modulus|betrag",
    "phase": r"phase|phas|phs|arg|angle",
    "coherence": r"coh\w*|gamma2?",
}
_WORD = r"(?:^|[\s_.:,;|(\[-])(?:{})(?:$|[\s_.:,;|(\[)\]-])"


def column_roles(table: TextTable) -> dict[str, int | str]:
    """Find the column, counted from 1, of each part that the headings name with certainty.

    A frequency is certain where one heading names it. The other parts are certain where, in addition, real and
    imaginary part, or magnitude and phase, are named once each.
    """
    columns: dict[str, list[int]] = {role: [] for role in _ROLES}
    for number, heading in enumerate(table.headings, 1):
        for role, words in _ROLES.items():
            if re.search(_WORD.format(words), heading, re.IGNORECASE):
                columns[role].append(number)
    if not columns["frequency"]:
        columns["frequency"] = [k for k, unit in enumerate(table.units, 1) if stated_frequency_unit(unit) is not None]
    named_once: dict[str, int | str] = {role: numbers[0] for role, numbers in columns.items() if len(numbers) == 1}
    for form in (("real", "imaginary"), ("magnitude", "phase")):
        if all(role in named_once for role in ("frequency", *form)):
            return {role: place for role, place in named_once.items() if role in ("frequency", *form, "coherence")}
    return {role: place for role, place in named_once.items() if role == "frequency"}


HERTZ = {"Hz": 1.0, "kHz": 1e3, "rad/s": 1 / (2 * np.pi)}  # factors to Hz


def stated_frequency_unit(text: str) -> str | None:
    """Read ``Hz``, ``kHz`` or ``rad/s`` from a column's unit; None for any other text."""
    return next((unit for unit in HERTZ if text.strip().lower() == unit.lower()), None)


def stated_phase_unit(text: str) -> str | None:
    """Read ``deg`` or ``rad`` from a column's unit; None for any other text."""
    spellings = {"deg": ("deg", "degree", "degrees", "°"), "rad": ("rad", "radian")}
    return next((unit for unit, words in spellings.items() if text.strip().lower() in words), None)
