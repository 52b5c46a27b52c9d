"""Step ``new mapping``: a commented mapping for a file of another program, or for its FRFs."""

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
from estimation import TextSource, looks_like_frf, open_source, unit_is_of_frf
from millfrf.core import InputError
from millfrf.core.described_tables import described_tables
from millfrf.core.steps import File, Reads, Writes, step
from millfrf.core.terminal import say, say_written

from .file_look import column_texts, dates, member_texts, notes, seen_csv_options, texts_of
from .guesses import Question, TimeColumn, even_step, guessed_channel, guessed_clock, is_time, split_heading
from .templates import FILL_IN, Row, template, toml_files, write_new

_MOST_COLUMNS = 64
_LONGER = 4  # ratio of length to width from which the longer axis is certainly time


@dataclass(frozen=True)
class NewMapping:
    """Text of a mapping, the number of its channels or FRF files, and the number of places to fill in."""

    text: str
    n_channels: int
    n_open: int


@step
def new_mapping(
    *files: Annotated[File, Reads("FILE")],
    frf: bool = False,
    out: Annotated[File | None, Writes(suffixes=(".toml",), needed=True)] = None,
) -> NewMapping:
    """Write a commented mapping with the columns, units and sample rate of a file, or of FRF files.

    Columns and arrays become channels. Time, sample rate and units are recognised by name. Quantities and places are
    guessed from names and marked as guesses. Missing or contradictory statements become questions. Several files, or
    headings of an FRF, get a mapping of FRFs, one a file.

    Parameters
    ----------
    files
        Recording of another program: .mat .csv .npz ..., or its FRFs, such as one file for X and one for Y.
    frf
        Whether the files hold FRFs; without it as their headings and their number say.
    out
        Mapping to write, for `millfrf convert`.

    Returns
    -------
    NewMapping
        Text of the mapping, number of channels, and number of places to fill in.

    Raises
    ------
    InputError
        The file cannot be read or contains no samples.

    Examples
    --------
    ::

        $ millfrf new mapping cut1.mat --out channels.toml
    """
    if not files:
        raise InputError("no file given; name a recording, or the files of FRFs")
    paths = [Path(file) for file in files]
    if frf or len(paths) > 1 or looks_like_frf(paths[0]):
        return _new_frf_mapping(paths, out)
    file, mapping = files[0], _mapping_for(paths[0])
    if out is not None:
        write_new(Path(out), mapping.text)
    say_written([out], f"{mapping.n_channels} channels; quantities and places are guessed from names, check them")
    if mapping.n_open:
        say(f"{mapping.n_open} places are open, each marked FILL IN; millfrf convert names what is missing")
    say(f"then: millfrf convert {file} recording.h5 --map {out}")
    return mapping


def _new_frf_mapping(paths: Sequence[Path], out: File | None) -> NewMapping:
    text = frf_mapping_text(paths)
    mapping = NewMapping(text, len(paths), sum(FILL_IN in line for line in text.splitlines()[4:]))
    if out is not None:
        write_new(Path(out), text)
    say_written([out], f"{mapping.n_channels} files of FRFs; directions are guessed from their names, check them")
    if mapping.n_open:
        say(f"{mapping.n_open} places are open, each marked FILL IN; millfrf convert names what is missing")
    say(f"then: millfrf convert {' '.join(map(str, paths))} frf.h5 --map {out}")
    return mapping


def _mapping_for(path: Path) -> NewMapping:
    """Create the mapping for ``millfrf convert``."""
    kind = next(file for file in toml_files() if file.name == "mapping")
    csv_options = seen_csv_options(path) if path.suffix.lower() in (".csv", ".txt") else {}
    file = open_arrays(path, **CsvOptions(**csv_options).model_dump())
    columns = list(_columns(file))
    channels = [column for column in columns if not is_time(split_heading(column.heading)[0], column.values)]
    if not channels:
        raise InputError(f"{path} contains no array of samples; it contains {_listed(file)}")
    rows: dict[str, Sequence[Row]] = {
        "": [{"recorded_at": _asked_time(file), **_clock(file, columns)}],
        "[[channels]]": _named_once([_channel(column) for column in channels]),
        **_axes(file),
        **({"[csv]": [csv_options]} if csv_options else {}),
    }
    lines = [
        f"Mapping of {path.name} for: millfrf convert {path.name} OUT.h5 --map THIS.toml",
        f"Quantities, nodes and directions are guessed from names: check each. Places marked {FILL_IN} are open.",
        f"The file holds {_listed(file)}.",
        *_left_out(file, columns),
        *_column_sources(file, columns),
        *_noted(file),
    ]
    title = "\n".join(lines)
    text = template(title, described_tables(kind), rows)
    return NewMapping(text, len(channels), text.count(FILL_IN) - title.count(FILL_IN))


@dataclass(frozen=True)
class _Column:
    """A column of samples."""

    place: dict[str, Any]
    heading: str
    unit: str
    values: NDArray[Any]


def _columns(opened: ArrayFile) -> Iterator[_Column]:
    """Yield the columns of samples and times by heading or number; leave out scalars and texts."""
    longest = _longest(opened)
    for name, values in opened.fields.items():
        if _length(values) != longest or longest < 2:
            continue
        single = len(opened.fields) == 1 and not _has_axes(values)
        array = {} if single else {"array": name}
        table = _columns_last(values)
        if table.shape[1] > _MOST_COLUMNS:
            raise InputError(
                f"array {name} has {table.shape[1]} columns, more than {_MOST_COLUMNS}; transpose it, or "
                "write a mapping"
            )
        if table.shape[1] == 1 and not opened.headings:
            heading, unit = member_texts(opened.fields, name)
            unit = opened.array_units.get(name, unit)
            yield _Column(array, heading or re.split(r"[./]", name)[-1], unit, table[:, 0])
            continue
        texts = column_texts(opened.fields, name, table.shape[1])
        units = opened.units or tuple(unit.strip("[]()") for unit in texts.units)
        for number in range(table.shape[1]):
            heading = (opened.headings or texts.names or _numbered(name, table.shape[1]))[number]
            unit = units[number] if units else ""
            unique = bool(opened.headings) and bool(heading) and opened.headings.count(heading) == 1
            place = {**array, "column": heading if unique else number + 1}
            yield _Column(place, heading or f"column {number + 1}", unit, table[:, number])


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


def _channel(column: _Column) -> dict[str, Any]:
    whole = bool(np.isrealobj(column.values)) and bool(np.all(column.values == np.round(column.values)))
    return {**guessed_channel(column.heading, column.unit, whole=whole), **column.place}


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


def _clock(opened: ArrayFile, columns: Sequence[_Column]) -> dict[str, Any]:
    """Return the key of the sample rate; return no key if the reader of the file knows the rate."""
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
    uniform = [(column.heading, step) for column in columns if (step := even_step(column.values)) > 0]
    hint = f"; {uniform[0][0]} rises evenly by {uniform[0][1]:.6g}" if uniform and not times else ""
    return guessed_clock(times, opened.fields, hint)


def _asked_time(opened: ArrayFile) -> Question:
    """Ask for the time of recording, which is never guessed, and show the dates in the file."""
    dates_in_file = dates(opened.fields)
    return Question(
        f"when was it recorded?{f' The file says {dates_in_file}.' if dates_in_file else ''} Left out: not known",
        open=False,
    )


def _array(column: _Column, opened: ArrayFile) -> str:
    return str(column.place.get("array", next(iter(opened.fields))))


def _axes(opened: ArrayFile) -> dict[str, list[Row]]:
    """Return tables for arrays whose rows are channels, with a question if the shape is ambiguous."""
    tables: dict[str, list[Row]] = {}
    for name, values in opened.fields.items():
        if opened.headings or _length(values) != _longest(opened) or not _has_axes(values):
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
    """Return one line on the numeric arrays that are no channels, because of their length or number of axes."""
    used = {column.place.get("array", next(iter(opened.fields))) for column in columns}
    other = [
        f"{name} {'x'.join(map(str, np.shape(values)))}"
        for name, values in opened.fields.items()
        if name not in used and isinstance(values, np.ndarray) and np.issubdtype(values.dtype, np.number)
        if values.size > 1
    ]
    return [f"Left out, since they are not as long as the longest or have more axes: {', '.join(other)}."] * bool(other)


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


_AXIS = re.compile(r"(?<![a-z])([xyz])(?![a-z])", re.IGNORECASE)
_UNITS = '"m/N", "um/N", "m/s^2/N", "g/N"'


def frf_mapping_text(paths: Sequence[Path]) -> str:
    """Return the commented mapping of FRF files, one FRF each where they are texts.

    Columns, arrays and units are those that the files name. The direction of a file is guessed from a lone x, y or z in
    its name; response and excitation are then the direct term at the tip.
    """
    uff = [path.name for path in paths if path.suffix.lower() in (".uff", ".unv")]
    if uff:
        raise InputError(f"{uff[0]} is UFF, which states what its FRFs are: millfrf convert {uff[0]} frf.h5")
    sources = [open_source(path) for path in paths]
    table, text = _table(sources[0]), isinstance(sources[0], TextSource)
    rows: dict[str, Sequence[Row]] = {"[frf]": [table]}
    if text or len(paths) > 1:
        rows["[[entries]]"] = [_entry(path, len(paths)) for path in paths]
    else:
        where = Question('degrees of freedom along that axis: ["TCP:+X", "TCP:+Y"]')
        order = Question('order of the axes: ["frequency", "response", "excitation"]', open=False)
        table |= {"responses": where, "excitations": where, "axes": order}
    names = " ".join(path.name for path in paths)
    title = (
        f"Mapping of FRFs for: millfrf convert {names} OUT.h5 --map THIS.toml\n"
        f"Directions are guessed from the files' names: check each. Places marked {FILL_IN} are open.\n"
        "Cross terms that no file gives are marked as not measured.\n"
        f"{paths[0].name} holds {sources[0].contents()}."
    )
    kind = next(file for file in toml_files() if file.name == "frf-mapping")
    return template(title, described_tables(kind), rows)


def _table(source: Any) -> dict[str, Any]:
    """Return the keys of ``[frf]``: the places of the numbers and their unit, or questions."""
    places = {name: place for name, place in source.roles().items() if name != "coherence"}
    values = [name for name in ("values", "real", "magnitude") if name in places]
    if not values and isinstance(source, TextSource) and len(source.table.headings) == 3:
        # three columns without headings: analysers write frequency, real and imaginary part
        places, values = {"frequency": 1, "real": 2, "imaginary": 3}, ["real"]
    keys: dict[str, Any] = dict(places)
    for name in ("frequency", *(() if values else ("values",))):
        keys.setdefault(name, Question(f"column or array, one of: {source.contents()}"))
    unit = source.unit(places[values[0]]) if values else ""
    keys["unit"] = unit if unit_is_of_frf(unit) else Question(f"of the FRF: {_UNITS} ...")
    if values == ["magnitude"]:
        keys.setdefault("phase_unit", Question('"deg" or "rad", where the heading does not say it', open=False))
    return keys


def _entry(path: Path, n_files: int) -> dict[str, Any]:
    axes = {axis.upper() for axis in _AXIS.findall(path.stem)}
    point: Any = f"TCP:+{axes.pop()}" if len(axes) == 1 else Question("node:direction, such as TCP:+X")
    return {"response": point, "excitation": point} | ({"file": path.name} if n_files > 1 else {})
