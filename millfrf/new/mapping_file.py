"""Step ``new mapping``: a commented mapping for a file of another program."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tomlkit
from numpy.typing import NDArray

from acquisition import ArrayFile, CsvOptions, open_arrays
from millfrf.core import InputError
from millfrf.core.described_tables import described_tables
from millfrf.core.steps import File, Reads, Writes, step
from millfrf.core.terminal import say, say_written

from .file_look import column_texts, dates, notes, seen_csv_options, texts_of
from .guesses import Question, TimeColumn, even_step, guessed_channel, guessed_clock, is_time, split_heading
from .templates import FILL_IN, Row, template, write_new
from .toml_files import toml_files

_MOST_COLUMNS = 64
_LONGER = 4
"""Times that an array must be longer than it is wide, so that the longer axis is surely that of time."""


@dataclass(frozen=True)
class NewMapping:
    """Text of a mapping, the number of its channels, and the number of places to fill in."""

    text: str
    n_channels: int
    n_open: int


@step
def new_mapping(
    file: Annotated[File, Reads("FILE")],
    /,
    *,
    out: Annotated[File | None, Writes(suffixes=(".toml",), needed=True)] = None,
) -> NewMapping:
    """Write a commented mapping with the columns, units and sample rate that a file tells.

    Columns and arrays become channels; a time column, a sample rate and units are recognised by name; quantities and
    places are guesses from names and marked as such. What the file does not tell, or contradicts, is asked.

    Parameters
    ----------
    file
        Recording of another program: .mat .csv .npz ...
    out
        Mapping to write, for `millfrf convert`.

    Returns
    -------
    NewMapping
        Text of the mapping, and the numbers of its channels and of its open places.

    Raises
    ------
    InputError
        A file that cannot be read, or one without samples.

    Examples
    --------
    ::

        $ millfrf new mapping cut1.mat --out channels.toml
    """
    mapping = _mapping_for(Path(file))
    if out is not None:
        write_new(Path(out), mapping.text)
    say_written([out], f"{mapping.n_channels} channels; quantities and places are guessed from names, check them")
    if mapping.n_open:
        say(f"{mapping.n_open} places are open, each marked FILL IN; millfrf convert names what is missing")
    say(f"then: millfrf convert {file} recording.h5 --map {out}")
    return mapping


def _mapping_for(path: Path) -> NewMapping:
    """Mapping that ``millfrf convert`` needs for a file."""
    kind = next(file for file in toml_files() if file.name == "mapping")
    written = seen_csv_options(path) if path.suffix.lower() in (".csv", ".txt") else {}
    opened = open_arrays(path, **CsvOptions(**written).model_dump())
    columns = list(_columns(opened))
    channels = [column for column in columns if not is_time(split_heading(column.heading)[0], column.values)]
    if not channels:
        raise InputError(f"{path} holds no array of samples; it has {_listed(opened)}")
    rows: dict[str, Sequence[Row]] = {
        "": [{"recorded_at": _asked_time(opened), **_clock(opened, columns)}],
        "[[channels]]": _named_once([_channel(column) for column in channels]),
        **_axes(opened),
        **({"[csv]": [written]} if written else {}),
    }
    lines = [
        f"Mapping of {path.name} for: millfrf convert {path.name} OUT.h5 --map THIS.toml",
        f"Quantities, nodes and directions are guessed from names: check each. Places marked {FILL_IN} are open.",
        f"The file holds {_listed(opened)}.",
        *_left_out(opened, columns),
        *_column_sources(opened, columns),
        *_noted(opened),
    ]
    title = "\n".join(lines)
    text = template(title, described_tables(kind), rows)
    return NewMapping(text, len(channels), text.count(FILL_IN) - title.count(FILL_IN))


@dataclass(frozen=True)
class _Column:
    """A column of samples: its place in the file, heading, unit and values."""

    place: dict[str, Any]
    heading: str
    unit: str
    values: NDArray[Any]


def _columns(opened: ArrayFile) -> Iterator[_Column]:
    """Columns of samples and of times: no single numbers, nor texts; each table's columns by heading or number."""
    longest = _longest(opened)
    for name, values in opened.fields.items():
        if _length(values) != longest or longest < 2:
            continue
        alone = len(opened.fields) == 1 and not _has_axes(values)
        array = {} if alone else {"array": name}
        table = _columns_last(values)
        if table.shape[1] > _MOST_COLUMNS:
            raise InputError(
                f"array {name} has {table.shape[1]} columns, more than {_MOST_COLUMNS}; turn it, or write a mapping"
            )
        if table.shape[1] == 1 and not opened.headings:
            yield _Column(array, re.split(r"[./]", name)[-1], opened.array_units.get(name, ""), table[:, 0])
            continue
        texts = column_texts(opened.fields, name, table.shape[1])
        units = opened.units or tuple(unit.strip("[]()") for unit in texts.units)
        for number in range(table.shape[1]):
            heading = (opened.headings or texts.names or _numbered(name, table.shape[1]))[number]
            unit = units[number] if units else ""
            once = bool(opened.headings) and bool(heading) and opened.headings.count(heading) == 1
            place = {**array, "column": heading if once else number + 1}
            yield _Column(place, heading or f"column {number + 1}", unit, table[:, number])


def _columns_last(values: NDArray[Any]) -> NDArray[Any]:
    """The array with samples along its first axis."""
    if values.ndim == 1:
        return values[:, None]
    return values if values.shape[0] >= values.shape[1] else values.T


def _numbered(name: str, count: int) -> list[str]:
    """Names of an array's columns; three of them are taken for X, Y and Z."""
    short = re.split(r"[./]", name)[-1]
    return [f"{short}_{'xyz'[number]}" if count == 3 else f"{short} {number + 1}" for number in range(count)]


def _column_sources(opened: ArrayFile, columns: Sequence[_Column]) -> list[str]:
    """A line for each array whose columns get names or units from other fields of the file."""
    counts = Counter(str(column.place["array"]) for column in columns if "array" in column.place)
    sources = [] if opened.headings else [column_texts(opened.fields, name, counts[name]).source for name in counts]
    return [line for line in sources if line]


def _noted(opened: ArrayFile) -> list[str]:
    """Texts and numbers that the file holds besides its samples, for whoever fills the mapping in."""
    lines = [] if opened.headings else list(notes(opened.fields))
    return ["It says beside them:", *lines] * bool(lines)


def _channel(column: _Column) -> dict[str, Any]:
    whole = bool(np.isrealobj(column.values)) and bool(np.all(column.values == np.round(column.values)))
    return {**guessed_channel(column.heading, column.unit, whole=whole), **column.place}


def _named_once(channels: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The channels, with a number behind names that several have."""
    counts = Counter(channel["name"] for channel in channels)
    seen: Counter[str] = Counter()
    for channel in channels:
        name = channel["name"]
        seen[name] += 1
        if counts[name] > 1:
            channel["name"] = f"{name} {seen[name]}"
    return channels


def _clock(opened: ArrayFile, columns: Sequence[_Column]) -> dict[str, Any]:
    """The key that tells the sample rate, where the file does not state it to the reader of all mappings."""
    if opened.sample_rate is not None:
        return {}
    times = [
        TimeColumn(
            str(
                column.place.get("column", column.place.get("array", "")) if opened.headings else _array(column, opened)
            ),
            column.unit or split_heading(column.heading)[1],
            column.values.astype(float),
        )
        for column in columns
        if is_time(split_heading(column.heading)[0], column.values)
    ]
    rising = [(column.heading, step) for column in columns if (step := even_step(column.values)) > 0]
    hint = f"; {rising[0][0]} rises evenly by {rising[0][1]:.6g}" if rising and not times else ""
    return guessed_clock(times, opened.fields, hint)


def _asked_time(opened: ArrayFile) -> Question:
    """The time of recording is never guessed; dates in the file are shown with the question."""
    stated = dates(opened.fields)
    return Question(
        f"when was it recorded?{f' The file says {stated}.' if stated else ''} Left out: not known", open=False
    )


def _array(column: _Column, opened: ArrayFile) -> str:
    return str(column.place.get("array", next(iter(opened.fields))))


def _axes(opened: ArrayFile) -> dict[str, list[Row]]:
    """Tables that say of arrays whose rows are channels that they are, and ask where the shape does not tell it."""
    tables: dict[str, list[Row]] = {}
    for name, values in opened.fields.items():
        if opened.headings or _length(values) != _longest(opened) or not _has_axes(values):
            continue
        rows, columns = values.shape
        heading = f"[arrays.{tomlkit.key(name).as_string()}]"
        if _in_doubt(values):
            asked = f'{rows} x {columns}: ["sample", "channel"], or ["channel", "sample"] where each row is a channel'
            tables[heading] = [{"axes": Question(asked, "[]")}]
        else:
            tables[heading] = [{"axes": ["channel", "sample"]}]
    return tables


def _has_axes(values: Any) -> bool:
    """Whether the order of an array's axes must be said: rows are channels, or it is nearly square."""
    return (
        _is_numeric(values)
        and values.ndim == 2
        and values.shape[0] > 1
        and (values.shape[0] < values.shape[1] or _in_doubt(values))
    )


def _in_doubt(values: NDArray[Any]) -> bool:
    return values.ndim == 2 and min(values.shape) > 1 and max(values.shape) < _LONGER * min(values.shape)


def _left_out(opened: ArrayFile, columns: Sequence[_Column]) -> list[str]:
    """One line on arrays of numbers that are no channels: of another length, or of more than two axes."""
    taken = {column.place.get("array", next(iter(opened.fields))) for column in columns}
    other = [
        f"{name} {'x'.join(map(str, np.shape(values)))}"
        for name, values in opened.fields.items()
        if name not in taken and isinstance(values, np.ndarray) and np.issubdtype(values.dtype, np.number)
        if values.size > 1
    ]
    return [f"Left out, since they are not as long as the longest or have more axes: {', '.join(other)}."] * bool(other)


def _is_numeric(values: Any) -> bool:
    return isinstance(values, np.ndarray) and np.issubdtype(values.dtype, np.number) and values.ndim in (1, 2)


def _longest(opened: ArrayFile) -> int:
    return max((size for size in map(_length, opened.fields.values())), default=0)


def _length(values: Any) -> int:
    """Number of samples; the longer axis is that of time."""
    return max(values.shape) if _is_numeric(values) else 0


def _listed(opened: ArrayFile) -> str:
    """What the file holds: arrays with their sizes, and lists of texts."""
    if opened.headings:
        return f"columns {', '.join(opened.headings)}"
    listed = [f"{name} {_size(values)}" for name, values in opened.fields.items() if not _is_single(values)]
    return f"arrays {', '.join(listed or opened.fields)}" if opened.fields else "no arrays"


def _is_single(values: Any) -> bool:
    return isinstance(values, str) or np.size(values) == 1


def _size(values: Any) -> str:
    texts = texts_of(values)
    return f"({len(texts)} texts)" if texts else "x".join(map(str, np.shape(values)))
