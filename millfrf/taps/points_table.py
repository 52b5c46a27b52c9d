"""The table that says which point was hit, and where the sensors stood, in which file: TOML or CSV."""

import csv
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from millfrf.core import DegreeOfFreedom, FileFormatError, InputError, mistake_in_words

_STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
OWN_COLUMNS = ("file", "hit", "from_s", "to_s")
"""Columns of a CSV table that are no channels."""


class PointRow(BaseModel):
    """Points that were hit and measured in one file, or in a part of it.

    Parameters
    ----------
    file
        Name of the recording, without its folder.
    hit
        Point and direction of the hammer, ``node:direction``; empty: as the file says.
    from_s : s
        Time from which this point was hit, on the recording's axis; left out: from the beginning.
    to_s : s
        Time until which this point was hit, after ``from_s``; left out: to the end.
    channels
        ``node:direction`` of channels that stood elsewhere than the file says, by name.
    """

    model_config = _STRICT
    file: Annotated[str, Field(min_length=1)]
    hit: str = ""
    from_s: float | None = None
    to_s: float | None = None
    channels: dict[str, str] = {}

    @model_validator(mode="after")
    def _checked(self) -> "PointRow":
        for text in (self.hit, *self.channels.values()):
            if text:
                DegreeOfFreedom.parse(text)
        if self.from_s is not None and self.to_s is not None and self.to_s <= self.from_s:
            raise ValueError(f"{self.file}: from_s = {self.from_s:g} is not before to_s = {self.to_s:g}")
        return self

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, s."""
        return (
            float("-inf") if self.from_s is None else self.from_s,
            float("inf") if self.to_s is None else self.to_s,
        )


class PointsTable(BaseModel):
    """The table of points: a row a recording, or a part of one.

    Parameters
    ----------
    recording
        Rows of the table, ``[[recording]]``, one for each recording or part of one.
    """

    model_config = _STRICT
    recording: Annotated[tuple[PointRow, ...], Field(min_length=1)]

    def rows_of(self, path: str | os.PathLike[str]) -> tuple[PointRow, ...]:
        """Rows of one recording, by its name."""
        return tuple(row for row in self.recording if Path(row.file).name == Path(path).name)


def read_points(path: str | os.PathLike[str]) -> PointsTable:
    """Read a table of points.

    TOML has one ``[[recording]]`` a file with ``file``, ``hit`` and, where needed, ``from_s``, ``to_s`` and
    ``channels = {ax = "P7:+X"}``. CSV has the columns ``file`` and ``hit``, where needed ``from_s`` and ``to_s``, and
    one column for each channel that moved, headed by its name.

    Raises
    ------
    InputError
        No such file, or another suffix.
    FileFormatError
        A table that is not understood; the message says which entry.
    """
    file = Path(path)
    if file.suffix.lower() not in (".toml", ".csv"):
        raise InputError(f"{file}: a table of points ends in .toml or .csv; change the suffix")
    if not file.is_file():
        raise InputError(f"no file {file}; check the name")
    try:
        text = file.read_text(encoding="utf-8-sig")
        content = tomllib.loads(text) if file.suffix.lower() == ".toml" else _of_csv(text, file)
        return PointsTable.model_validate(content)
    except ValidationError as error:
        raise FileFormatError(f"{file}: {mistake_in_words(error, PointsTable)}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise FileFormatError(f"{file} is not readable text in its format ({error}); mend that line") from error
    except InputError as error:
        raise FileFormatError(f"{file}: {error}") from error


def _of_csv(text: str, path: Path) -> Mapping[str, Any]:
    """The same content as TOML gives; cells that are empty are left out."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    delimiter = ";" if lines and lines[0].count(";") > lines[0].count(",") else ","
    table = csv.DictReader(lines, delimiter=delimiter, skipinitialspace=True)
    headings = [heading.strip() for heading in table.fieldnames or ()]
    if "file" not in headings:
        raise InputError(f"the first line of {path.name} has no column 'file' but {', '.join(headings) or 'nothing'}")
    table.fieldnames = headings
    rows: list[dict[str, Any]] = []
    for number, cells in enumerate(table):
        if None in cells:
            raise InputError(f"row {number + 1} has more cells than the first line has headings; count the commas")
        known = {key: value.strip() for key, value in cells.items() if value and value.strip()}
        row: dict[str, Any] = {key: known[key] for key in OWN_COLUMNS if key in known}
        row["channels"] = {key: value for key, value in known.items() if key not in OWN_COLUMNS}
        rows.append(row)
    return {"recording": rows}
