"""`mapping_for`: a commented mapping for a file of another program, with what the file tells filled in."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit

from acquisition import ArrayFile, CsvOptions, open_arrays
from foundation import InputError

from ...toml_files import described_tables, toml_files
from .channel_guesses import guessed_channel, split_heading
from .template import FILL_IN, Row, template

_RATES = ("fs", "samplerate", "sample_rate", "samplingrate", "sampling_rate", "srate", "f_s", "rate")
_TIMES = ("t", "time", "times", "zeit", "timestamp")
_TIME_UNITS = {"": "s", "s": "s", "sec": "s", "ms": "ms", "us": "us", "µs": "us"}
_MOST_COLUMNS = 64


@dataclass(frozen=True)
class NewMapping:
    """Text of a mapping, the number of its channels, and the number of places that are left to fill in."""

    text: str
    n_channels: int
    n_open: int


def mapping_for(path: Path) -> NewMapping:
    """Read a file and write the mapping that `millfrf convert` needs for it.

    Columns and arrays become channels; a time column, a sample rate and units are recognised by name; quantities and
    places are guesses from names and marked as such. What nothing tells is left out and marked.

    Raises
    ------
    InputError
        A file that cannot be read, or one without samples.
    """
    kind = next(file for file in toml_files() if file.name == "mapping")
    opened = open_arrays(path, **CsvOptions().model_dump())
    columns = list(_columns(opened))
    if not columns:
        raise InputError(f"{path} holds no array of samples; it has {_listed(opened)}")
    channels = [_channel(column) for column in columns]
    rows: dict[str, Sequence[Row]] = {"": [_clock(opened)], "[[channels]]": channels, **_axes(opened)}
    title = (
        f"Mapping of {path.name} for: millfrf convert {path.name} OUT.h5 --map THIS.toml\n"
        f"Quantities, nodes and directions are guessed from names: check each. Places marked {FILL_IN} are open.\n"
        f"The file holds {_listed(opened)}."
    )
    text = template(title, described_tables(kind), rows)
    return NewMapping(text, len(channels), text.count(FILL_IN) - 1)


@dataclass(frozen=True)
class _Column:
    """A column of samples: where it is found, and what is written above it."""

    place: dict[str, Any]
    heading: str
    unit: str


def _columns(opened: ArrayFile) -> Iterator[_Column]:
    """Columns of samples: not times, nor single numbers, nor texts; each table's columns by heading or number."""
    longest = max((size for size in map(_length, opened.fields.values())), default=0)
    for name, values in opened.fields.items():
        if _length(values) != longest or longest < 2 or _is_time(name):
            continue
        array = {} if len(opened.fields) == 1 else {"array": name}
        count = _width(values)
        if count == 1 and not opened.headings:
            yield _Column(array, name.rpartition("/")[2], "")
            continue
        if count > _MOST_COLUMNS:
            raise InputError(
                f"array {name} has {count} columns, more than {_MOST_COLUMNS}; turn it, or write a mapping"
            )
        for number in range(count):
            heading = opened.headings[number] if opened.headings else _numbered(name, number, count)
            if opened.headings and _is_time(split_heading(heading)[0]):
                continue
            unit = opened.units[number] if opened.units else ""
            yield _Column({**array, "column": heading if opened.headings else number + 1}, heading, unit)


def _numbered(name: str, number: int, count: int) -> str:
    """Name of an array's column; three of them are taken for X, Y and Z."""
    short = re.split(r"[./]", name)[-1]
    return f"{short}_{'xyz'[number]}" if count == 3 else f"{short} {number + 1}"


def _channel(column: _Column) -> dict[str, Any]:
    return {**guessed_channel(column.heading, column.unit), **column.place}


def _clock(opened: ArrayFile) -> dict[str, Any]:
    """The key that tells the sample rate, where the file tells it."""
    for heading, unit in zip(opened.headings, opened.units or [""] * len(opened.headings), strict=True):
        name, bracketed = split_heading(heading)
        if _is_time(name) and (unit or bracketed).lower() in _TIME_UNITS:
            return {"time": heading, "time_unit": _TIME_UNITS[(unit or bracketed).lower()]}
    for name, values in opened.fields.items():
        if re.sub(r"[\s-]", "_", name.rpartition(".")[2].lower()) in _RATES and np.size(values) == 1:
            return {"sample_rate": name}
    for name, values in opened.fields.items():
        if _is_time(name) and _length(values) > 1:
            return {"time": name}
    return {}


def _axes(opened: ArrayFile) -> dict[str, list[Row]]:
    """Tables that say of arrays whose rows are channels that they are."""
    wide = [
        name for name, values in opened.fields.items() if _is_numeric(values) and 1 < values.shape[0] < _length(values)
    ]
    return {f"[arrays.{tomlkit.key(name).as_string()}]": [{"axes": ["channel", "sample"]}] for name in wide}


def _is_time(name: str) -> bool:
    return name.rpartition(".")[2].strip().lower() in _TIMES


def _is_numeric(values: Any) -> bool:
    return isinstance(values, np.ndarray) and np.issubdtype(values.dtype, np.number) and values.ndim in (1, 2)


def _length(values: Any) -> int:
    """Number of samples; the longer axis is that of time."""
    return max(values.shape) if _is_numeric(values) else 0


def _width(values: Any) -> int:
    return 1 if values.ndim == 1 else int(min(values.shape))


def _listed(opened: ArrayFile) -> str:
    if opened.headings:
        return f"columns {', '.join(opened.headings)}"
    shapes = [f"{name} {'x'.join(map(str, np.shape(values)))}" for name, values in opened.fields.items()]
    return f"arrays {', '.join(shapes)}" if shapes else "no arrays"
