"""CSV tables: a plain heading and rows in the table itself, warnings and provenance in a side file beside it.

The side file ``TABLE.csv-metadata.json`` follows CSV on the Web (W3C 2015, *Metadata Vocabulary for Tabular Data*):
headings, units and datatypes of the columns; in ``notes`` the warnings, the provenance and the table's SHA-256.
"""

import csv
import hashlib
import io
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from .errors import FileFormatError, InputError
from .tables import apart, provenance_above
from .whole_files import writing_whole_file

SIDE = "-metadata.json"
"""What the name of a side file adds to that of its table."""

_CONTEXT = "http://www.w3.org/ns/csvw"
_MAKER = "millfrf"
# Characters with which a spreadsheet begins a formula, or that it drops before one (OWASP, CSV injection)
_FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "\uff1d", "\uff0b", "\uff0d", "\uff20")
_NOT_FINITE = {"inf": "INF", "-inf": "-INF", "nan": "NaN"}  # as XML Schema writes them, which CSV on the Web adopts
_UNITS = {
    "rpm": "r/min",
    "hz": "Hz",
    "m": "m",
    "mm": "mm",
    "um": "um",
    "s": "s",
    "kg": "kg",
    "n": "N",
    "nm": "N m",
    "deg": "deg",
    "rad": "rad",
    "m_per_n": "m/N",
    "n_per_m": "N/m",
    "pct": "%",
}


@dataclass(frozen=True)
class CsvTable:
    """A table as it was read.

    Parameters
    ----------
    columns
        Headings in the order of the cells, without the apostrophes of :func:`harmless`.
    rows
        Cells of each row as text.
    warnings
        Warnings stored with the table; one more if its side file is lost, foreign, or older than the table.
    provenance
        Step, sources, options and versions; empty if nothing is known.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)


def side_file(path: str | os.PathLike[str]) -> Path:
    """Return the place of a table's side file.

    Examples
    --------
    >>> side_file("lobes.csv").name
    'lobes.csv-metadata.json'
    """
    return Path(path).with_name(Path(path).name + SIDE)


def is_side_file(path: str | os.PathLike[str]) -> bool:
    """Return whether a name is that of a table's side file."""
    return Path(path).name.lower().endswith(f".csv{SIDE}")


def write_csv(
    path: str | os.PathLike[str],
    columns: Sequence[str],
    rows: Iterable[Sequence[object]],
    *,
    warnings: Sequence[str] = (),
    provenance: Mapping[str, Any] | None = None,
) -> None:
    """Write a table and its side file.

    A number is written with nine digits, NaN as an empty cell; text that is a number is written as it is. Text that a
    spreadsheet would run as a formula gets an apostrophe in front, which :func:`read_csv` takes away.

    Parameters
    ----------
    path
        Table to write.
    columns
        Headings; the unit of a column is the end of its heading, ``depth_limit_m``.
    rows
        Cells of each row.
    warnings
        Warnings about the table, one sentence each.
    provenance
        Step, sources, options and versions, see ``millfrf.core.provenance.origin``.
    """
    cells = [[_cell(value) for value in row] for row in rows]
    stream = io.StringIO(newline="")
    csv.writer(stream).writerows([[harmless(name) for name in columns], *cells])
    content = stream.getvalue().encode("utf-8")
    datatypes = [_datatype([row[number] for row in cells]) for number in range(len(columns))]
    note = {"sha256": hashlib.sha256(content).hexdigest(), "warnings": list(warnings)}
    described = side_text(Path(path).name, columns, datatypes, {**note, "provenance": dict(provenance or {})})
    # both are on the disk before either replaces an old file: a full disk leaves the old pair
    with writing_whole_file(side_file(path)) as side, writing_whole_file(path) as table:
        side.write_text(described, encoding="utf-8")
        table.write_bytes(content)


def read_csv(path: str | os.PathLike[str]) -> CsvTable:
    """Read a table, its warnings and its provenance; older tables have them in lines ``# ...`` above the headings.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No text in UTF-8, or no heading.
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        with Path(path).open(encoding="utf-8-sig", newline="") as file:
            lines = file.readlines()
        start = next((number for number, line in enumerate(lines) if not line.startswith("#")), len(lines))
        table = [[plain_text(cell) for cell in row] for row in csv.reader(lines[start:]) if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise FileFormatError(f"{path} is no CSV table in UTF-8 ({error}); give the table as it was written") from error
    if not table:
        raise FileFormatError(f"{path} has no line of headings; give the table as it was written")
    columns, rows = tuple(table[0]), tuple(tuple(row) for row in table[1:])
    if start:
        return CsvTable(columns, rows, apart(lines[:start])[0], provenance_above(lines[:start]))
    notes, doubts = side_note(path)
    return CsvTable(columns, rows, (*notes.get("warnings", ()), *doubts), notes.get("provenance", {}))


def harmless(text: str) -> str:
    """Return a text that no spreadsheet runs: an apostrophe stands before the beginning of a formula.

    Examples
    --------
    >>> harmless("=1+1"), harmless("-1.5"), harmless("S1:+X"), harmless("'=a")
    ("'=1+1", '-1.5', 'S1:+X', "''=a")
    """
    return f"'{text}" if text.lstrip("'").startswith(_FORMULA) and not _is_number(text) else text


def plain_text(cell: str) -> str:
    """Return the text that :func:`harmless` was given.

    Examples
    --------
    >>> plain_text("'=1+1"), plain_text("'tis")
    ('=1+1', "'tis")
    """
    return cell[1:] if cell.startswith("'") and cell.lstrip("'").startswith(_FORMULA) else cell


def _is_number(text: str) -> bool:
    return re.fullmatch(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(INF|NaN)", text) is not None


def _cell(value: object) -> str:
    text = str(value)
    if isinstance(value, float | np.floating):
        text = "" if np.isnan(value) else f"{value + 0.0:.9g}"
    return harmless(_NOT_FINITE.get(text, text))


def side_text(name: str, columns: Sequence[str], datatypes: Sequence[str], note: Mapping[str, Any]) -> str:
    """Return the text of a side file: a table of CSV on the Web.

    Parameters
    ----------
    name
        Name of the table.
    columns, datatypes
        Headings, and a datatype of XML Schema for each: ``string``, ``integer`` or ``double``.
    note
        What is said of the table: ``sha256`` of its bytes, ``warnings``, ``provenance`` and more.
    """
    listed = []
    for heading, datatype in zip(columns, datatypes, strict=True):
        column: dict[str, Any] = {"titles": harmless(heading)}
        if re.fullmatch(r"[A-Za-z][A-Za-z0-9_.]*", heading):
            column = {"name": heading, **column}
        column["datatype"], unit = datatype, _unit(heading)
        if datatype != "string" and unit:
            column |= {"datatype": "double", "schema:unitText": unit}
        listed.append(column)
    made_from = [source["file"] for source in note.get("provenance", {}).get("sources", []) if "file" in source]
    described = {
        "@context": [_CONTEXT, {"@language": "en"}],
        "url": name,
        "dc:creator": _MAKER,
        **({"dc:source": made_from} if made_from else {}),
        "tableSchema": {"columns": listed},
        "notes": [dict(note)],
    }
    return json.dumps(described, indent=1, ensure_ascii=False) + "\n"


def _datatype(cells: Sequence[str]) -> str:
    """Return the datatype of a column: empty cells are missing values of any type."""
    filled = [cell for cell in cells if cell]
    if not filled or not all(map(_is_number, filled)):
        return "string"
    return "integer" if all(re.fullmatch(r"[+-]?\d+", cell) for cell in filled) else "double"


def _unit(heading: str) -> str:
    """Return the unit at the end of a heading, ``angle_deg`` or ``time [s]``; empty if there is none."""
    bracket = re.search(r"[\[(]([^\])]+)[\])]$", heading)
    if bracket:
        return bracket[1]
    return next((text for end, text in sorted(_UNITS.items(), key=_longest) if heading.endswith(f"_{end}")), "")


def _longest(item: tuple[str, str]) -> int:
    return -len(item[0])


def side_note(path: str | os.PathLike[str]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return what the side file says of a table, and a doubt if it is lost, foreign or older than the table."""
    table, side = Path(path), side_file(path)
    if not side.is_file():
        return {}, (f"{table.name} has lost {side.name}: its warnings and sources are not known; copy both files",)
    try:
        note = dict(json.loads(side.read_text(encoding="utf-8"))["notes"][0])
        digest = note.pop("sha256")
        note |= {"warnings": [str(text) for text in note["warnings"]], "provenance": dict(note["provenance"])}
    except (OSError, ValueError, KeyError, IndexError, TypeError, RecursionError):
        return {}, (f"{side.name} is not by {_MAKER}: the warnings and sources of {table.name} are not known",)
    with table.open("rb") as file:
        is_same = digest == hashlib.file_digest(file, "sha256").hexdigest()
    doubt = f"{table.name} was changed after it was written: its content is not that which {side.name} describes"
    return note, () if is_same else (doubt,)
