"""Lines of a text file in any encoding, packed or not, and their cells as numbers or times of a clock."""

import codecs
import csv
import datetime
import gzip
import mmap
import re
import zlib
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import Annotated, Literal, overload

import numpy as np
from pydantic import BaseModel, Field

from millfrf.core import FileFormatError, InputError, Real, time_unit

from ..channels import STRICT
from ..settings import SETTINGS

BLANKS = " "
"""Delimiter of columns that any number of blanks separate."""

# texts by which programs mark a missing value
_MISSING = ("", "-", "--", "---", "?", "*", "na", "n/a", "n.a.", "nan", "#n/a", "#nv", "null", "none", "inf", "-inf")
_DATE = r"(?:(?P<year>\d{4})[-/](?P<month>\d\d?)[-/](?P<day>\d\d?)|(?P<other>\d\d?[./]\d\d?[./]\d{4}))"
_TIME = r"(?P<hour>\d\d?):(?P<minute>\d\d):(?P<second>\d\d(?:[.,]\d+)?)(?: ?(?P<half>[AP]M))?"
_CLOCK = re.compile(rf"(?:{_DATE})?(?(year)[T ]?|(?(other)[T ]?))(?:{_TIME})?(?:Z|[+-]\d\d:?\d\d)?", re.IGNORECASE)
_DAY = 86400.0  # s
_BLOCK, _LINES = 1 << 24, 1 << 15  # bytes and lines that are handled at a time: few MB


class TextOptions(BaseModel):
    """Layout of a text file, if it is not recognised.

    Parameters
    ----------
    delimiter
        Character between columns, a blank for any number of blanks; left out: recognised from the file.
    decimal
        Decimal sign; left out: recognised from the file.
    skip_lines
        Number of lines at the top that are left out, before the headings.
    encoding
        Encoding of the text; left out: recognised from the file.
    """

    model_config = STRICT
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = None
    decimal: Literal[".", ","] | None = None
    skip_lines: Annotated[int, Field(ge=0)] = 0
    encoding: str | None = None


class TextLines(Sequence[str]):
    """Lines of a text, without blanks at their ends, decoded when they are asked for; blank ones at the end are cut.

    Parameters
    ----------
    data
        The text, in an encoding in which a line ends with the byte of a line feed.
    encoding
        Encoding, a name of Python's.
    """

    def __init__(self, data: "bytes | mmap.mmap", encoding: str) -> None:
        self._data, self._encoding = data, encoding
        parts = [np.array([len(codecs.BOM_UTF8) if data[:3] == codecs.BOM_UTF8 else 0])]
        for start in range(0, len(data), _BLOCK):
            block = np.frombuffer(data[start : start + _BLOCK], dtype=np.uint8)
            parts.append(np.flatnonzero(block == ord("\n")) + start + 1)
        self._starts = np.concatenate([*parts, [len(data) + 1]])  # one line feed more ends the last line
        self._length = len(self._starts) - 1
        while self._length and not self[self._length - 1]:
            self._length -= 1

    def __len__(self) -> int:
        return self._length

    @overload
    def __getitem__(self, index: int) -> str: ...
    @overload
    def __getitem__(self, index: slice) -> list[str]: ...
    def __getitem__(self, index: int | slice) -> str | list[str]:
        if isinstance(index, int):
            return self[index : index + 1 or None][0]
        first, stop, _ = index.indices(self._length)
        if stop <= first:
            return []
        text = self._data[self._starts[first] : self._starts[stop] - 1].decode(self._encoding)
        return [line.rstrip() for line in text.split("\n")]

    def holds(self, sign: str) -> bool:
        """Return whether any line holds a character, a single byte."""
        return self._data.find(sign.encode("ascii")) >= 0

    def __iter__(self) -> Iterator[str]:
        for first in range(0, self._length, _LINES):
            yield from self[first : first + _LINES]


def lines_of(path: Path, encoding: str | None = None) -> TextLines:
    """Return the lines of a text file; also of one packed with gzip.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        A damaged packed file, or text of another encoding.
    """
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        with path.open("rb") as file:
            is_packed = path.suffix.lower() == ".gz" or file.read(2) == b"\x1f\x8b"  # the signature of gzip
            size = path.stat().st_size
            data = (
                _unpacked(path) if is_packed else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) if size else b""
            )
    except (OSError, EOFError, zlib.error) as error:
        raise FileFormatError(f"{path} is damaged or cut short ({error}); copy or export it again") from error
    encoding = _encoding(path, data, encoding)
    if codecs.lookup(encoding).name == "utf-8-sig":
        encoding = "utf-8"
    if "\n".encode(encoding) != b"\n":
        data, encoding = data[:].decode(encoding).encode("utf-8"), "utf-8"
    if _has_bare_returns(data):
        data = data[:].replace(b"\r\n", b"\n").replace(b"\r", b"\n")
    return TextLines(data, encoding)


def _unpacked(path: Path) -> bytes:
    with gzip.open(path) as packed:
        data = packed.read(SETTINGS.largest_unpacked_bytes + 1)
    if len(data) > SETTINGS.largest_unpacked_bytes:
        raise FileFormatError(f"{path} unpacks to more than {SETTINGS.largest_unpacked_bytes} bytes; unpack it first")
    return data


def _blocks(data: "bytes | mmap.mmap") -> Iterator[bytes]:
    return (data[start : start + _BLOCK] for start in range(0, len(data), _BLOCK))


def _has_bare_returns(data: "bytes | mmap.mmap") -> bool:
    """Return whether lines end with a carriage return alone, as on old computers."""
    return any(block.rstrip(b"\r").count(b"\r") != block.count(b"\r\n") for block in _blocks(data))


def _encoding(path: Path, data: "bytes | mmap.mmap", encoding: str | None) -> str:
    """Return the encoding of a text, of which all bytes are tried."""
    if encoding is None:
        encoding = _wide_encoding(data[:1000])
    # latin-1 decodes any bytes, so that it is the last
    for code_page in (encoding,) if encoding else ("utf-8", "cp1252", "latin-1"):
        try:
            decoder = codecs.getincrementaldecoder(code_page)()
            for block in _blocks(data):
                decoder.decode(block)
            decoder.decode(b"", final=True)
            return code_page
        except (UnicodeDecodeError, LookupError):
            continue
    raise FileFormatError(
        f"{path} is not text of encoding {encoding}; save it as UTF-8, or set encoding under [csv], such as cp1252"
    )


def _wide_encoding(data: bytes) -> str | None:
    """Recognise UTF-16 by its byte order mark, or by zeros in every other byte of digits and Latin letters."""
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    head = data[:1000]
    for encoding, zeros, letters in (("utf-16-le", head[1::2], head[::2]), ("utf-16-be", head[::2], head[1::2])):
        if zeros and zeros.count(0) > 0.9 * len(zeros) and not letters.count(0):
            return encoding
    return None


def cells_of(line: str, delimiter: str) -> list[str]:
    """Split a line into cells without quotation marks and blanks around them; an empty last cell is left out.

    Examples
    --------
    >>> cells_of('"0,5"; 1,5;', ";"), cells_of("  1   2", BLANKS)
    (['0,5', '1,5'], ['1', '2'])
    """
    if '"' in line:
        separated = next(csv.reader([line.strip()], delimiter=delimiter, skipinitialspace=True), [])
    else:
        separated = line.split() if delimiter == BLANKS else line.split(delimiter)
    cells = [cell.strip() for cell in separated if cell or delimiter != BLANKS]
    return cells[:-1] if len(cells) > 1 and not cells[-1] else cells  # some programs end lines with a delimiter


def number_text(cell: str, decimal: str) -> str | None:
    """Return a cell as Python writes numbers; None if it is no number with this decimal sign.

    Examples
    --------
    >>> number_text("1,5", ","), number_text("1.5", ","), number_text("1.5D-3", ".")
    ('1.5', None, '1.5E-3')
    """
    text = cell if decimal == "." else cell.replace(".", "x").replace(decimal, ".")
    if text[-1:].isdigit() and ("D" in text or "d" in text):  # exponents of Fortran
        text = text.upper().replace("D", "E", 1)
    try:
        float(text)
    except ValueError:
        return None
    return text if "_" not in text else None


def printed_digit(cell: str) -> float:
    """Return the value of the last digit of a number, or of the seconds of a clock time.

    Examples
    --------
    >>> printed_digit("1.9990"), printed_digit("1,25E+02"), printed_digit("10:00:00.001")
    (0.0001, 1.0, 0.001)
    """
    if cell.lower().strip("+-") in ("nan", "inf", "infinity"):
        return 1.0
    mantissa, _, exponent = cell.rpartition(":")[2].upper().replace(",", ".").partition("E")
    decimals = len(mantissa.rstrip("Z ").partition(".")[2])
    return float(f"1e{(int(exponent) if exponent else 0) - decimals}")


def is_mark(cell: str) -> bool:
    """Return whether a cell marks a missing value."""
    return cell.lower() in _MISSING


def is_clock(cell: str) -> bool:
    """Return whether a cell is a date, a time of day with seconds, or both.

    Examples
    --------
    >>> is_clock("2026-01-01T10:00:00.001Z"), is_clock("10:00:00,5"), is_clock("1.5"), is_clock("02.03.2026")
    (True, True, False, True)
    """
    return (
        len(cell) >= len("1:00:00")
        and (":" in cell or cell[-4:].isdigit() or cell[:4].isdigit())
        and ((match := _CLOCK.fullmatch(cell)) is not None and any(match.group("year", "other", "hour")))
    )


def is_number(cell: str) -> bool:
    """Return whether a cell is a number with any decimal sign."""
    return any(number_text(cell, decimal) is not None for decimal in ".,")


def may_be_value(cell: str) -> bool:
    """Return whether a cell is a number with any decimal sign, a time of a clock, or marks a missing number."""
    return is_mark(cell) or is_clock(cell) or is_number(cell)


def clock_seconds(cells: Sequence[str]) -> list[float]:
    """Return the seconds since the first of the stamps of a column.

    Times of day that fall by more than half a day have passed midnight. Of dates that are not written year first, only
    a change is read, as the next day.

    Examples
    --------
    >>> clock_seconds(["23:59:59.5", "00:00:00.25"]), clock_seconds(["2026-01-31", "2026-02-01"])
    ([0.0, 0.75], [0.0, 86400.0])
    """
    seconds: list[float] = []
    first_day, days, last_date, last_time = None, 0, "", 0.0
    for cell in cells:
        match = _CLOCK.fullmatch(cell)
        if match is None:
            raise ValueError(cell)
        of_day = _seconds_of_day(match)
        if match["year"]:
            days = datetime.date(int(match["year"]), int(match["month"]), int(match["day"])).toordinal()
        elif (last_date and match["other"] != last_date) or (not match["other"] and of_day < last_time - _DAY / 2):
            days += 1
        last_date, last_time = match["other"] or "", of_day
        first_day = days if first_day is None else first_day
        seconds.append((days - first_day) * _DAY + of_day)
    return [second - seconds[0] for second in seconds]


def _seconds_of_day(match: re.Match[str]) -> float:
    if match["hour"] is None:
        return 0.0
    hour = int(match["hour"])
    if match["half"]:
        hour = hour % 12 + 12 * (match["half"].upper() == "PM")
    return 3600.0 * hour + 60.0 * int(match["minute"]) + float(match["second"].replace(",", "."))


def numbers_with_clocks(rows: Sequence[list[str]], width: int, decimal: str, clocks: Collection[int]) -> Real:
    """Return cells as numbers, (n_rows, width), times of clocks as seconds since the first.

    ``clocks`` are the columns of clocks; a column of dates is added to that of the time of day.
    """
    if any(len(row) != width for row in rows):
        raise ValueError("rows of several lengths")
    columns = [list(column) for column in zip(*rows, strict=True)]
    dates = [k for k in clocks if ":" not in columns[k][0]]
    times = [k for k in clocks if ":" in columns[k][0]]
    values = np.empty((len(rows), width))
    for k, column in enumerate(columns):
        if k in clocks:
            if [k] == times and len(dates) == 1:
                column = [f"{date} {cell}" for date, cell in zip(columns[dates[0]], column, strict=True)]
            values[:, k] = clock_seconds(column)
        else:
            values[:, k] = [float(number_text(cell, decimal) or "x") for cell in column]
    return values


def without_brackets(unit: str) -> str:
    """Return a unit without one pair of brackets around it."""
    inner = unit.strip()[1:-1]
    plain = unit.strip()[:1] + unit.strip()[-1:] in ("[]", "()") and not any(sign in inner for sign in "[]()")
    return inner if plain else unit


def unit_in(heading: str) -> str:
    """Return the text in the last pair of brackets at the end of a heading, or a unit of time after a slash.

    Other units after a slash may be part of a ratio.

    Examples
    --------
    >>> unit_in("Re(H) ((m/s²)/N)"), unit_in("Phase [deg]"), unit_in("t / ms"), unit_in("Re m/s / N")
    ('(m/s²)/N', 'deg', 'ms', '')
    """
    after_slash = heading.rpartition(" / ")[2].strip()
    if after_slash != heading.strip() and time_unit(after_slash) is not None:
        return after_slash
    text, depth = heading.strip(), 0
    for place in range(len(text) - 1, -1, -1):
        depth += (text[place] in ")]") - (text[place] in "([")
        if depth == 0:
            return text[place + 1 : -1] if place < len(text) - 1 else ""
    return ""
