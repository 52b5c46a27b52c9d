"""Excitation and response points of hammer tests: from a table, an option, or the recordings."""

import csv
import os
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from acquisition import Channel, opened
from estimation import TapTest, choose_channels
from millfrf.core import Band, DegreeOfFreedom, FileFormatError, InputError, mistake_in_words, tables_of_setup
from millfrf.core.steps import Typed

AUTO, NONE = "auto", "none"
WindowTime = Annotated[str | float, Typed("TEXT", str)]


@dataclass(frozen=True)
class TapOptions:
    """Options of :func:`millfrf.steps.tap.tap`; stored with the FRF."""

    segment: float | None
    pre_trigger: float | None
    force_window: str | float
    exponential: str | float
    point: str
    points: Path | None
    excitations: tuple[str, ...]
    responses: tuple[str, ...]
    band: Band | None
    stream: str | None

    def __post_init__(self) -> None:
        if self.point and self.points is not None:
            raise InputError(f"both --point {self.point} and --points {self.points} are given; give one of them")
        self.force_window_seconds  # noqa: B018 - refuses a wrong text before the taps are searched
        self.time_constant  # noqa: B018

    @property
    def force_window_seconds(self) -> float | None:
        """Time after the peak, s; 0: no force window; None: automatic."""
        return _seconds("--force-window", self.force_window)

    @property
    def time_constant(self) -> float | None:
        """Time constant of the exponential window, s; 0: no window; None: automatic."""
        return _seconds("--exponential", self.exponential)


def _seconds(option: str, text: str | float) -> float | None:
    if text in (AUTO, NONE):
        return None if text == AUTO else 0.0
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"{option} {text} is not understood; give auto, none or a time in s above 0")
    return value


_STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
OWN_COLUMNS = ("file", "hit", "from_s", "to_s")  # columns of a CSV table that are no channels


class PointRow(BaseModel):
    """Excitation and response points in one file, or in a part of it.

    Parameters
    ----------
    file
        Name of the recording, without its folder.
    hit
        Point and direction of the hammer, ``node:direction``; empty: as stated in the file.
    from_s : s
        Time from which this point was hit, on the recording's axis; left out: from the beginning.
    to_s : s
        Time until which this point was hit, after ``from_s``; left out: to the end.
    channels
        ``node:direction`` by name of channels that were at other points than the file states.
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
        raise FileFormatError(f"{file} is not readable text in its format ({error}); correct that line") from error
    except InputError as error:
        raise FileFormatError(f"{file}: {error}") from error


def _of_csv(text: str, path: Path) -> Mapping[str, Any]:
    """Convert the content of a CSV table to the form of the TOML table; leave out empty cells."""
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
        filled = {key: value.strip() for key, value in cells.items() if value and value.strip()}
        row: dict[str, Any] = {key: filled[key] for key in OWN_COLUMNS if key in filled}
        row["channels"] = {key: value for key, value in filled.items() if key not in OWN_COLUMNS}
        rows.append(row)
    return {"recording": rows}


def tests_of(paths: Sequence[str | os.PathLike[str]], options: TapOptions) -> list[TapTest]:
    """Tests of the recordings: one each, or one for each of its rows in the table of points.

    The excitation point is that of the table, else of the option, else ``point`` in the table ``[hammer]`` of the
    recording's set-up, else of the force channel. Response points are those of the table, else of the channels.
    """
    table = None if options.points is None else read_points(options.points)
    tests = [test for path in paths for test in _tests(Path(path), table, options)]
    unknown = sorted({test.path.name for test in tests for channel in test.excitations if not channel.node})
    if unknown and len(tests) > 1:
        raise InputError(
            f"nothing says which point was hit in {', '.join(unknown[:5])}{' ...' if len(unknown) > 5 else ''}; give "
            "--points TABLE.csv with the columns file and hit, or --point NODE:DIRECTION if it was always the same"
        )
    return tests


def _tests(path: Path, table: PointsTable | None, options: TapOptions) -> list[TapTest]:
    with opened(path) as recording:
        source = recording.stream(options.stream)
        forces = options.excitations or [channel.name for channel in source.channels if channel.quantity == "force"]
        exciting, responding = choose_channels(source, forces or None, options.responses or None)
        twice = sorted({channel.name for channel in exciting} & {channel.name for channel in responding})
        if twice:
            raise InputError(f"channel {twice[0]} is named as excitation and as response; name it once")
        stated = options.point or _of_setup(recording.setup, path.name)
    if table is None:
        return [_test(path, exciting, responding, PointRow(file=path.name, hit=stated), options.stream)]
    rows = table.rows_of(path)
    if not rows:
        raise InputError(f"{path.name} is not in {options.points}; add a row that says which point was hit in it")
    rows = tuple(row if row.hit else row.model_copy(update={"hit": stated}) for row in rows)
    return [_test(path, exciting, responding, row, options.stream) for row in rows]


def _of_setup(setup: str, file: str) -> str:
    """Return ``point`` of the table ``[hammer]`` in a recording's set-up; an empty text if it is missing."""
    point = str(tables_of_setup(setup).get("hammer", {}).get("point", ""))
    if point:
        try:
            DegreeOfFreedom.parse(point)
        except InputError as error:
            raise InputError(f"{file}: point in [hammer] of its set-up: {error}") from error
    return point


def _test(
    path: Path, exciting: Sequence[Channel], responding: Sequence[Channel], row: PointRow, stream: str | None
) -> TapTest:
    names = [channel.name for channel in (*exciting, *responding)]
    missing = [name for name in row.channels if name not in names]
    if missing:
        raise InputError(
            f"{path.name}: the table of points has a column or key {missing[0]!r}, which is none of the channels used "
            f"({', '.join(names)}); correct the name"
        )
    if row.hit and len(exciting) > 1:
        raise InputError(
            f"{path.name}: one point hit, {row.hit}, but {len(exciting)} forces ({', '.join(names[: len(exciting)])}); "
            "name the hammer's channel with --excitation, or each channel's point in the table"
        )
    places = {exciting[0].name: row.hit, **row.channels} if row.hit else dict(row.channels)
    return TapTest(
        path,
        tuple(_moved(channel, places.get(channel.name, "")) for channel in exciting),
        tuple(_moved(channel, places.get(channel.name, "")) for channel in responding),
        stream,
        row.span,
    )


def _moved(channel: Channel, place: str) -> Channel:
    """Return the channel moved to the point ``place``; unchanged if ``place`` is empty."""
    if not place:
        return channel
    point = DegreeOfFreedom.parse(place)
    return replace(channel, node=point.node, direction=point.direction)
