"""CSV files: ours, which describe themselves in comment lines, and those of other programs."""

import csv
import io
import json
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError

from ..recordings.recording_format import check_format, stream_from_attributes
from .content import ArraySamples, Content
from .writers import event_texts

_MISSING = ("", "-", "--", "---", "?", "*", "na", "n/a", "n.a.", "nan", "#n/a", "#nv", "null", "none", "inf", "-inf")
"""How programs mark a value that is missing."""


@dataclass(frozen=True)
class CsvTable:
    """Columns of numbers with their headings and units (empty where the file has none); values (n_rows, n_columns)."""

    headings: tuple[str, ...]
    values: NDArray[np.float64]
    units: tuple[str, ...] = ()


def read_csv(
    path: Path, *, delimiter: str | None = None, decimal: str = ".", skip_lines: int = 0, encoding: str = "utf-8-sig"
) -> CsvTable:
    """Read a table of numbers; lines that begin with ``#`` are comments.

    A row of texts is headings, a further one below it their units. Marks of missing values (``-``, ``NaN``, ``n/a``)
    and numbers with another decimal sign are no such texts: a row of them is a row of values, and refused as such.

    Parameters
    ----------
    delimiter
        Sign between the columns; None: semicolon or tabulator where the first line holds one, else comma.
    decimal
        Decimal sign, a point or a comma.
    skip_lines
        Number of lines to skip at the top.

    Raises
    ------
    FileFormatError
        Rows of unequal length, or a field that is no number; with its line.
    """
    text = read_text(path, encoding)
    lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if n > skip_lines]
    rows = [(n, line) for n, line in lines if line.strip() and not line.startswith("#")]
    if not rows:
        raise FileFormatError(f"{path} holds no rows of numbers; check the file and skip_lines")
    chosen = delimiter or usual_delimiter(rows[0][1], decimal)
    heads: list[tuple[str, ...]] = []
    while rows and len(heads) < 2:
        fields = tuple(field.strip() for field in next(csv.reader([rows[0][1]], delimiter=chosen)))
        if not is_row_of_texts(fields) or (heads and not _is_units(fields, len(heads[0]))):
            break
        heads.append(fields)
        rows = rows[1:]
    headings, units = (*heads, (), ())[:2]
    return CsvTable(headings, _parse(rows, chosen, decimal, path), units)


def usual_delimiter(line: str, decimal: str) -> str:
    """Semicolon or tabulator where a line holds one, else comma; never the decimal sign.

    Examples
    --------
    >>> usual_delimiter("0,001;1,5", "."), usual_delimiter("t,Fx", "."), usual_delimiter("t", ",")
    (';', ',', ';')
    """
    found = max(";\t", key=line.count)
    return found if found in line or decimal == "," else ","


def is_row_of_texts(fields: Sequence[str]) -> bool:
    """Whether some cell is a text: neither empty nor a number, in either decimal sign, nor a mark of a missing value.

    Examples
    --------
    >>> is_row_of_texts(["s", "-"]), is_row_of_texts(["NaN", "-"]), is_row_of_texts(["0,5", "1,5"])
    (True, False, False)
    """
    return any(not _is_number_of_any(field) and field.strip().lower() not in _MISSING for field in fields)


def _is_units(fields: Sequence[str], width: int) -> bool:
    """Whether a row of texts below headings is units: one for each heading, and none that begins as a number does."""
    begun = [field.lstrip("+-").lstrip("[(")[:1].isdigit() for field in fields]
    inverse = [field.startswith(("1/", "10^")) for field in fields]
    return len(fields) == width and not any(b and not i for b, i in zip(begun, inverse, strict=True))


def read_text(path: Path, encoding: str = "utf-8-sig") -> str:
    """The file's text.

    Raises
    ------
    FileFormatError
        It is not of that encoding.
    """
    try:
        return path.read_text(encoding=encoding)
    except (UnicodeDecodeError, LookupError) as error:
        raise FileFormatError(
            f"{path} is not text of encoding {encoding}; save it as UTF-8, or set encoding under [csv], such as cp1252"
        ) from error


def describes_itself(path: Path) -> bool:
    """Whether the CSV file was written by this program."""
    with path.open("rb") as handle:
        return handle.readline(200).startswith(b"# format: ")


def read_own_csv(path: Path) -> Content:
    """Read what this program wrote, with its description.

    Raises
    ------
    FileFormatError
        The description or a row is damaged.
    """
    metadata: dict[str, Any] = {}
    for line in read_text(path).splitlines():
        if not line.startswith("# "):
            break
        key, _, value = line[2:].partition(": ")
        try:
            metadata[key] = json.loads(value)
        except json.JSONDecodeError as error:
            raise FileFormatError(f"{path}: comment line {key!r} is not JSON ({error}); convert anew") from error
    check_format(metadata, path)
    values = read_csv(path, delimiter=",").values[:, 1:]  # the first column is time
    attributes = {**metadata, "channels": json.dumps(metadata.get("channels"))}
    described = stream_from_attributes(str(metadata.get("stream", "main")), attributes, values.shape[1], path)
    kept = values.astype(np.float32) if metadata.get("dtype") == "float32" else values
    try:
        events = {
            name: (np.array(times, dtype=float), np.array(series, dtype=float))
            for name, (times, series) in metadata.get("events", {}).items()
        }
        clock = np.array(metadata.get("clock", []), dtype=float).reshape(-1, 2)
    except (TypeError, ValueError, AttributeError) as error:
        raise FileFormatError(f"{path}: comment lines 'events' or 'clock' are damaged; convert anew") from error
    notes = event_texts(metadata.get("event_texts"), events, path)
    title, setup, recorded_at = (str(metadata.get(name, "")) for name in ("title", "setup", "recorded_at"))
    return Content((ArraySamples(described, kept),), title, setup, recorded_at, events, {described.name: clock}, notes)


def _parse(rows: list[tuple[int, str]], delimiter: str, decimal: str, path: Path) -> NDArray[np.float64]:
    def lines() -> Iterator[str]:
        for _, line in rows:
            yield line if decimal == "." else line.replace(decimal, ".")

    if not rows:
        raise FileFormatError(f"{path} holds headings but no rows of numbers; export the samples too")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return np.loadtxt(io.StringIO("\n".join(lines())), delimiter=delimiter, ndmin=2, comments=None)
    except (ValueError, Warning) as error:
        raise FileFormatError(f"{path}: {_offence(rows, delimiter, decimal)}; mend the file or its mapping") from error


def _offence(rows: list[tuple[int, str]], delimiter: str, decimal: str) -> str:
    """The first row that is not like the others, or not of numbers."""
    width = len(rows[0][1].split(delimiter))
    for number, line in rows:
        fields = line.split(delimiter)
        if len(fields) != width:
            return f"line {number} has {len(fields)} columns, the first row has {width}"
        for column, field in enumerate(fields, 1):
            if not _is_number(field, decimal):
                other = (
                    "" if not _is_number_of_any(field) else "; its decimal sign is the other: see decimal under [csv]"
                )
                return f"line {number}, column {column}: {field.strip()[:40]!r} is not a number{other}"
    return "it cannot be read as a table of numbers"


def _is_number_of_any(field: str) -> bool:
    return _is_number(field, ".") or _is_number(field, ",")


def _is_number(field: str, decimal: str) -> bool:
    try:
        float(field.strip().replace(decimal, "."))
    except ValueError:
        return False
    return True
