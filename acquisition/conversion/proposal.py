"""Proposal of a mapping for a recording of another program: what its file says, guesses from names, and questions."""

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from millfrf.core import InputError

from .array_file import ArrayFile
from .guesses import (
    Question,
    TimeColumn,
    column_texts,
    dates,
    even_step,
    guessed_channel,
    guessed_clock,
    is_open_hammer,
    is_time,
    member_texts,
    notes,
    split_heading,
    texts_of,
)
from .mapping import RecordingMapping
from .read_arrays import open_arrays
from .sample_axis import are_one_rate, looks_like_clock

_MOST_COLUMNS = 64
_SHORT = 0.9  # least length of a channel, over that of the longest
_LONGER = 4  # ratio of length to width from which the longer axis is certainly time
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Proposal:
    """Tables of a mapping by heading, with a `Question` for each value to fill in; lines on the file; the file."""

    rows: Mapping[str, Sequence[Row]]
    lines: tuple[str, ...]
    file: ArrayFile

    @property
    def n_channels(self) -> int:
        """Return the number of channels."""
        return len(self.rows["[[channels]]"])

    @property
    def open_keys(self) -> tuple[str, ...]:
        """Return the keys that must be filled in, each with its question."""
        return tuple(
            f"{row.get('name', heading) if heading else ''} {key}: {value.text}".strip()
            for heading, rows in self.rows.items()
            for row in rows
            for key, value in row.items()
            if isinstance(value, Question) and value.open
        )

    def mapping(self) -> RecordingMapping:
        """Return the mapping, of which no key may be open."""
        known = {heading: [_answered(row) for row in rows] for heading, rows in self.rows.items()}
        arrays = {
            tomlkit.parse(f"{heading}\n")["arrays"].popitem()[0]: rows[0]
            for heading, rows in known.items()
            if heading.startswith("[arrays.")
        }
        return RecordingMapping.model_validate(
            {**known[""][0], "channels": known["[[channels]]"], "arrays": arrays}, strict=False
        )


def unit_free(proposal: Proposal) -> RecordingMapping:
    """Return the mapping in which channels of unknown quantity or unit are dimensionless, as sound files hold them.

    Raises
    ------
    InputError
        Something else than quantities, units and places is unknown, such as the sample rate.
    """
    channels = [
        {**row, "quantity": "dimensionless", "unit": "1", "sensitivity": 1.0}  # whatever unit the file says
        if any(isinstance(row.get(key), Question) for key in ("quantity", "unit"))
        else row
        for row in proposal.rows["[[channels]]"]
    ]
    known = replace(proposal, rows={**proposal.rows, "[[channels]]": channels})
    if known.open_keys:
        raise InputError(
            f"{proposal.file.path} does not say {known.open_keys[0]}; convert it: millfrf new mapping "
            f"{proposal.file.path.name} --out map.toml, then millfrf convert"
        )
    return known.mapping()


def _answered(row: Row) -> dict[str, Any]:
    return {key: value for key, value in row.items() if not isinstance(value, Question)}


def proposed_mapping(path: Path) -> Proposal:
    """Propose the mapping of a recording.

    Raises
    ------
    InputError
        The file cannot be read or contains no samples.
    """
    file = open_arrays(path)
    columns = list(_columns(file))
    times = [column for column in columns if _is_time(column, file)]
    channels = [column for column in columns if column not in times]
    if not channels:
        raise InputError(f"{path} contains no array of samples; it contains {_listed(file)}")
    _require_samples(path, file, columns, times)
    clock = _clock(file, times, columns)
    _require_length(file, channels, clock)
    tapped = any(is_open_hammer(column.heading) for column in channels)
    rows: dict[str, Sequence[Row]] = {
        "": [{"recorded_at": _asked_time(file), **clock, **_lengths(channels)}],
        "[[channels]]": _named_once([_channel(column, file, tapped) for column in channels]),
        **_axes(file),
    }
    lines = (
        f"The file holds {_listed(file)}.",
        *([f"Of its lines, {file.table.account}."] if file.table is not None else []),
        *_left_out(file, columns),
        *_column_sources(file, columns),
        *_noted(file),
    )
    return Proposal(rows, lines, file)


def _require_samples(path: Path, file: ArrayFile, columns: "Sequence[_Column]", times: "Sequence[_Column]") -> None:
    """Refuse spectra: complex arrays, and columns over a frequency."""
    is_complex = [column.heading for column in columns if np.iscomplexobj(column.values)]
    over = [
        column.heading
        for column in columns
        if re.search(r"^f$|freq|frequenz|^hz$", split_heading(column.heading)[0].strip(), re.IGNORECASE)
        or (column.unit or split_heading(column.heading)[1]).strip().lower() in ("hz", "khz", "cpm", "order")
        if np.isrealobj(column.values) and bool((np.diff(column.values.astype(float)) > 0).all())
    ]
    stated = {
        **{name.lower(): texts[0].lower() for name, value in file.fields.items() if len(texts := texts_of(value)) == 1},
        **{row[0].lower(): "".join(row[1:]).lower() for row in (file.table.header if file.table else ()) if row},
    }
    over += [name for name, text in stated.items() if text == "hz" and re.search(r"x_values.*label$|axis_?unit$", name)]
    if is_complex or (over and not times and all(file.axis_of(column.array) is None for column in columns)):
        reason = f"{is_complex[0]} is complex" if is_complex else f"its columns are over {over[0]!r}"
        raise InputError(
            f"{path} holds no samples over time: {reason}; of FRFs, millfrf new mapping {path.name} --frf --out "
            "map.toml writes a mapping; power spectra are not read"
        )


def _require_length(file: ArrayFile, columns: "Sequence[_Column]", clock: Mapping[str, Any]) -> None:
    """Refuse matrices, of which neither their shape nor anything else in the file says that they are samples."""
    longest = max(len(column.values) for column in columns)
    matrices = {column.array for column in columns if np.ndim(file.fields[column.array]) > 1}
    matrices = {name for name in matrices if min(np.shape(file.fields[name])) > 1}
    is_open = isinstance(clock.get("sample_rate"), Question)
    if file.table is None and matrices and is_open and longest < _LONGER * len(columns):
        sizes = ", ".join(f"{name} {_size(file.fields[name])}" for name in sorted(matrices))
        raise InputError(
            f"{file.path} holds matrices ({sizes}) and nothing that says that they are samples over time; if they are, "
            "save them as columns of a text with a column of times"
        )


@dataclass(frozen=True, eq=False)
class _Column:
    """A column of samples."""

    place: dict[str, Any]
    heading: str
    unit: str
    values: NDArray[Any]
    array: str


def _columns(opened: ArrayFile) -> Iterator[_Column]:
    """Yield the columns of samples and times by heading or number; leave out scalars and texts."""
    for name in _chosen(opened):
        values = opened.fields[name]
        single = len(opened.fields) == 1 and not _has_axes(values)
        array = {} if single else {"array": name}
        table = values if opened.table is not None else _columns_last(values)
        if table.shape[1] > _MOST_COLUMNS:
            raise InputError(
                f"array {name} has {table.shape[1]} columns, more than {_MOST_COLUMNS}; transpose it, or "
                "write a mapping"
            )
        if table.shape[1] == 1 and opened.table is None:
            heading, unit = member_texts(opened.fields, name)
            unit = opened.unit_of(name, 0) or unit
            yield _Column(array, heading or name.rpartition("/" if "/" in name else ".")[2], unit, table[:, 0], name)
            continue
        texts = column_texts(opened.fields, name, table.shape[1])
        units = opened.units or tuple(unit.strip("[]()") for unit in texts.units)
        for number in range(table.shape[1]):
            heading = (opened.headings or texts.names or _numbered(name, table.shape[1]))[number]
            unit = units[number] if units else ""
            unique = bool(opened.headings) and bool(heading) and opened.headings.count(heading) == 1
            place = {**array, "column": heading if unique else number + 1}
            yield _Column(place, heading or f"column {number + 1}", unit, table[:, number], name)


def _chosen(opened: ArrayFile) -> list[str]:
    """Return the arrays of samples: those as long as the longest; of a file with rates, the rate of most arrays."""
    longest = _longest(opened)
    axes = {
        name: axis
        for name in opened.fields
        if (axis := opened.axis_of(name)) is not None and _length(opened.fields[name]) >= 2
    }
    if axes:
        groups = [[name for name in axes if are_one_rate(axes[name], axis, longest)] for axis in axes.values()]
        return max(groups, key=lambda group: (len(group), axes[group[0]].rate))
    shortest = _SHORT * longest if opened.facts else longest  # channels of one device may lack their last samples
    return [name for name, values in opened.fields.items() if longest >= 2 and _length(values) >= shortest]


def _lengths(columns: Sequence[_Column]) -> dict[str, Any]:
    """Ask whether arrays of one rate and unequal lengths keep their first samples."""
    lengths = {column.array: len(column.values) for column in columns}
    short, long = min(lengths, key=lambda name: lengths[name]), max(lengths.values())
    if lengths[short] == long:
        return {}
    question = f"{short} holds {lengths[short]} of {long} samples: true keeps the first {lengths[short]} of each"
    return {"common_length": Question(question, "false")}


def _is_time(column: _Column, opened: ArrayFile) -> bool:
    """Return whether a column holds times: by its name, as clock times, or as the first of a table without headings."""
    number = column.place.get("column", 1)
    if opened.table is not None and isinstance(number, int) and not opened.headings:
        return number - 1 in opened.table.clocks or (number == 1 and looks_like_clock(column.values))
    if opened.table is not None and opened.headings and opened.table.column(number, "time") in opened.table.clocks:
        return True
    name, unit = split_heading(column.heading)
    return is_time(name, column.values, column.unit or unit)


def _columns_last(values: NDArray[Any]) -> NDArray[Any]:
    """Return the array with samples along its first axis."""
    if values.ndim == 1:
        return values[:, None]
    return values if values.shape[0] >= values.shape[1] else values.T


def _numbered(name: str, count: int) -> list[str]:
    """Name the columns of an array; three columns are X, Y and Z."""
    short = re.split(r"[./]", name)[-1]
    return [f"{short}_{'xyz'[number]}" if count == 3 else f"{short} {number + 1}" for number in range(count)]


def _column_sources(opened: ArrayFile, columns: Sequence[_Column]) -> list[str]:
    """Return one line for each array with names or units from other fields of the file."""
    counts = Counter(str(column.place["array"]) for column in columns if "array" in column.place)
    sources = [] if opened.headings else [column_texts(opened.fields, name, counts[name]).source for name in counts]
    return [line for line in sources if line]


def _noted(opened: ArrayFile) -> list[str]:
    """Return the texts and numbers of the file that may help to fill in the mapping."""
    lines = [] if opened.headings else list(notes(opened.fields))
    return ["It says beside them:", *lines] * bool(lines)


def _channel(column: _Column, opened: ArrayFile, tapped: bool) -> dict[str, Any]:
    whole = bool(np.isrealobj(column.values)) and bool(np.all(column.values == np.round(column.values)))
    said = opened.facts.get(column.array)
    keys = guessed_channel(column.heading, column.unit, whole=whole, tapped=tapped)
    if said is not None and said.quantity:
        keys["quantity"] = said.quantity
        keys |= {"unit": said.unit} if said.unit else {}
    if said is not None and said.node:
        keys |= {"node": said.node, "direction": said.direction}
    return {**keys, **column.place}


def _named_once(channels: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Add a number to names that several channels have."""
    counts = Counter(channel["name"] for channel in channels)
    counted: Counter[str] = Counter()
    for channel in channels:
        name = channel["name"]
        counted[name] += 1
        if counts[name] > 1:
            channel["name"] = f"{name} {counted[name]}"
    return channels


def _clock(opened: ArrayFile, times: Sequence[_Column], columns: Sequence[_Column]) -> dict[str, Any]:
    """Return the key of the sample rate or of the times; no key if the file states the rate."""
    if all(opened.axis_of(column.array) is not None for column in columns):
        return {}
    named = [
        TimeColumn(
            column.place.get("column", column.array) if opened.table is not None else column.array,
            column.unit or split_heading(column.heading)[1],
            np.asarray(column.values, dtype=float),
            None
            if opened.table is None
            else opened.table.resolutions[opened.table.column(column.place["column"], "time")],
        )
        for column in times
    ]
    uniform = [(column.heading, step) for column in columns if (step := even_step(column.values)) > 0]
    hint = f"; {uniform[0][0]} rises evenly by {uniform[0][1]:.6g}" if uniform and not times else ""
    return guessed_clock(named, opened.fields, hint)


def _resolution(opened: ArrayFile, column: _Column) -> float | None:
    """Return the last digit with which a column of a text was printed."""
    table = opened.table
    return None if table is None else table.resolutions[table.column(column.place["column"], "time")]


def _asked_time(opened: ArrayFile) -> Question:
    """Ask for the time of recording, which is never guessed, and show the dates in the file."""
    dates_in_file = opened.recorded_at or dates(opened.fields)
    return Question(
        f"when was it recorded?{f' The file says {dates_in_file}.' if dates_in_file else ''} Left out: not known",
        open=False,
    )


def _axes(opened: ArrayFile) -> dict[str, list[Row]]:
    """Return tables for arrays whose rows are channels, with a question if the shape is ambiguous."""
    tables: dict[str, list[Row]] = {}
    for name, values in opened.fields.items():
        if opened.table is not None or _length(values) != _longest(opened) or not _has_axes(values):
            continue
        rows, columns = values.shape
        heading = f"[arrays.{tomlkit.key(name).as_string()}]"
        if _in_doubt(values):
            question = (
                f'{rows} x {columns}: ["sample", "channel"], or ["channel", "sample"] where each row is a channel'
            )
            tables[heading] = [{"axes": Question(question, "[]")}]
        else:
            tables[heading] = [{"axes": ["channel", "sample"]}]
    return tables


def _has_axes(values: Any) -> bool:
    """Return whether the order of the axes must be stated: rows are channels, or the array is nearly square."""
    return (
        _is_numeric(values)
        and values.ndim == 2
        and values.shape[0] > 1
        and (values.shape[0] < values.shape[1] or _in_doubt(values))
    )


def _in_doubt(values: NDArray[Any]) -> bool:
    return values.ndim == 2 and min(values.shape) > 1 and max(values.shape) < _LONGER * min(values.shape)


def _left_out(opened: ArrayFile, columns: Sequence[_Column]) -> list[str]:
    """Return one line on the numeric arrays that are no channels, because of their length, axes or rate."""
    used = {column.array for column in columns}
    other = [
        f"{name} {'x'.join(map(str, np.shape(values)))}" + (f" at {axis.rate:g} Hz" if axis is not None else "")
        for name, values in opened.fields.items()
        if name not in used and isinstance(values, np.ndarray) and np.issubdtype(values.dtype, np.number)
        if values.size > 1
        for axis in [opened.axis_of(name)]
    ]
    reason = "of another rate, or not as long as the longest or with more axes"
    if not any(opened.axis_of(name) for name in opened.fields):
        reason = "since they are not as long as the longest or have more axes"
    return [f"Left out, {reason}: {', '.join(other)}."] * bool(other)


def _is_numeric(values: Any) -> bool:
    return isinstance(values, np.ndarray) and np.issubdtype(values.dtype, np.number) and values.ndim in (1, 2)


def _longest(opened: ArrayFile) -> int:
    return max((size for size in map(_length, opened.fields.values())), default=0)


def _length(values: Any) -> int:
    """Return the number of samples, the size of the longer axis."""
    return max(values.shape) if _is_numeric(values) else 0


def _listed(opened: ArrayFile) -> str:
    """List the columns, or the arrays with sizes."""
    if opened.headings:
        return f"columns {', '.join(opened.headings)}"
    listed = [f"{name} {_size(values)}" for name, values in opened.fields.items() if not _is_single(values)]
    return f"arrays {', '.join(listed or opened.fields)}" if opened.fields else "no arrays"


def _is_single(values: Any) -> bool:
    return isinstance(values, str) or np.size(values) <= 1


def _size(values: Any) -> str:
    texts = texts_of(values)
    return f"({len(texts)} texts)" if texts else "x".join(map(str, np.shape(values)))
