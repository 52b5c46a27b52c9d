"""CSV files of this program, with a description in comment lines, and CSV files of other programs."""

import csv
import io
import json
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from millfrf.core import FileFormatError, Real

from ..recordings.recording_format import check_format, stream_from_attributes
from .content import Content, samples_of_array
from .writers import event_texts

# texts by which programs mark a missing value
_MISSING = ("", "-", "--", "---", "?", "*", "na", "n/a", "n.a.", "nan", "#n/a", "#nv", "null", "none", "inf", "-inf")

NumberedLines = list[tuple[int, str]]  # lines of a file with their numbers, for messages


@dataclass(frozen=True)
class CsvTable:
    """Columns of numbers with their headings and units (empty if the file has none); values (n_rows, n_columns)."""

    headings: tuple[str, ...]
    values: Real
    units: tuple[str, ...] = ()


def read_csv(
    path: Path, *, delimiter: str | None = None, decimal: str = ".", skip_lines: int = 0, encoding: str = "utf-8-sig"
) -> CsvTable:
    """Read a table of numbers; lines that begin with ``#`` are comments.

    See `CsvOptions` for the options.

    A first row of texts holds headings, a second row of texts their units. Marks of missing values (``-``, ``NaN``,
    ``n/a``) and numbers with a wrong decimal sign do not count as texts: they belong to a row of values, which is then
    refused.
    """
    lines: NumberedLines = list(enumerate(_read_text(path, encoding).splitlines(), 1))[skip_lines:]
    rows = [(number, line) for number, line in lines if line.strip() and not line.startswith("#")]
    if not rows:
        raise FileFormatError(f"{path} holds no rows of numbers; check the file and skip_lines")
    if delimiter is None:
        delimiter = _usual_delimiter(rows[0][1], decimal)
    heads: list[tuple[str, ...]] = []
    while rows and len(heads) < 2:
        fields = tuple(field.strip() for field in next(csv.reader([rows[0][1]], delimiter=delimiter)))
        if not _has_text(fields) or (heads and not _is_row_of_units(fields, len(heads[0]))):
            break
        heads.append(fields)
        rows = rows[1:]
    headings, units = (*heads, (), ())[:2]
    return CsvTable(headings, _parse_rows(rows, delimiter, decimal, path), units)


def _usual_delimiter(line: str, decimal: str) -> str:
    """Return semicolon or tabulator if the line holds one, else comma; never the decimal sign.

    Examples
    --------
    >>> _usual_delimiter("0,001;1,5", "."), _usual_delimiter("t,Fx", "."), _usual_delimiter("t", ",")
    (';', ',', ';')
    """
    candidate = max(";\t", key=line.count)
    return candidate if candidate in line or decimal == "," else ","


def _has_text(fields: Sequence[str]) -> bool:
    """Return whether a field is neither a number, with any decimal sign, nor a mark of a missing value.

    Examples
    --------
    >>> _has_text(["s", "-"]), _has_text(["NaN", "-"]), _has_text(["0,5", "1,5"])
    (True, False, False)
    """
    return any(not _is_number(field, ".,") and field.strip().lower() not in _MISSING for field in fields)


def _is_row_of_units(fields: Sequence[str], width: int) -> bool:
    """Return whether a row of texts below the headings holds one unit per heading: no unit begins with a digit."""
    starts_with_digit = [field.lstrip("+-").lstrip("[(")[:1].isdigit() for field in fields]
    is_inverse = [field.startswith(("1/", "10^")) for field in fields]  # units such as 1/min
    return len(fields) == width and not any(
        digit and not inverse for digit, inverse in zip(starts_with_digit, is_inverse, strict=True)
    )


def _read_text(path: Path, encoding: str = "utf-8-sig") -> str:
    try:
        return path.read_text(encoding=encoding)
    except (UnicodeDecodeError, LookupError) as error:
        raise FileFormatError(
            f"{path} is not text of encoding {encoding}; save it as UTF-8, or set encoding under [csv], such as cp1252"
        ) from error


def is_own_csv(path: Path) -> bool:
    with path.open("rb") as handle:
        return handle.readline(200).startswith(b"# format: ")


def read_own_csv(path: Path) -> Content:
    """Read a CSV file that this program wrote, with its description."""
    metadata: dict[str, Any] = {}
    for line in _read_text(path).splitlines():
        if not line.startswith("# "):
            break
        key, _, value = line[2:].partition(": ")
        try:
            metadata[key] = json.loads(value)
        except json.JSONDecodeError as error:
            raise FileFormatError(f"{path}: comment line {key!r} is not JSON ({error}); convert it again") from error
    check_format(metadata, path)
    values = read_csv(path, delimiter=",").values[:, 1:]  # the first column is time
    attributes = {**metadata, "channels": json.dumps(metadata.get("channels"))}
    stream = stream_from_attributes(str(metadata.get("stream", "main")), attributes, values.shape[1], path)
    samples = samples_of_array(stream, values.astype(np.float32) if metadata.get("dtype") == "float32" else values)
    try:
        events = {
            name: (np.array(times, dtype=float), np.array(series, dtype=float))
            for name, (times, series) in metadata.get("events", {}).items()
        }
        clock = np.array(metadata.get("clock", []), dtype=float).reshape(-1, 2)
    except (TypeError, ValueError, AttributeError) as error:
        raise FileFormatError(f"{path}: comment lines 'events' or 'clock' are damaged; convert it again") from error
    texts = event_texts(metadata.get("event_texts"), events, path)
    title, setup, recorded_at = (str(metadata.get(name, "")) for name in ("title", "setup", "recorded_at"))
    return Content((samples,), title, setup, recorded_at, events, {stream.name: clock}, texts)


def _parse_rows(rows: NumberedLines, delimiter: str, decimal: str, path: Path) -> Real:
    if not rows:
        raise FileFormatError(f"{path} holds headings but no rows of numbers; export the samples too")
    text = "\n".join(line.replace(decimal, ".") for _, line in rows)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.loadtxt(io.StringIO(text), delimiter=delimiter, ndmin=2, comments=None)
    except (ValueError, Warning) as error:
        mistake = _first_mistake(rows, delimiter, decimal)
        raise FileFormatError(f"{path}: {mistake}; correct the file or its mapping") from error


def _first_mistake(rows: NumberedLines, delimiter: str, decimal: str) -> str:
    """Describe the first row with another length than the first row, or with a field that is no number."""
    width = len(rows[0][1].split(delimiter))
    for number, line in rows:
        fields = line.split(delimiter)
        if len(fields) != width:
            return f"line {number} has {len(fields)} columns, the first row has {width}"
        for column, field in enumerate(fields, 1):
            if not _is_number(field, decimal):
                hint = "; its decimal sign is the other: see decimal under [csv]" if _is_number(field, ".,") else ""
                return f"line {number}, column {column}: {field.strip()[:40]!r} is not a number{hint}"
    return "it cannot be read as a table of numbers"


def _is_number(field: str, decimals: str) -> bool:
    """Return whether a field is a number with one of the decimal signs."""
    for decimal in decimals:
        try:
            float(field.strip().replace(decimal, "."))
            return True
        except ValueError:
            continue
    return False
