"""Conversion of recordings: a file of one kind into a file, or several, of another."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, writing_whole_file

from ..recordings.recording import Recording
from ..sources.source import StreamDescription
from .array_file import ArrayFile, open_arrays
from .content import ArraySamples, Content, part_of, recording_content
from .csv_file import describes_itself, read_own_csv
from .mapping import ArrayMapping, ChannelMapping, RecordingMapping, load_mapping
from .writers import from_fields, require_writable, write_content

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6}
_UNEVEN = 0.01
"""Largest departure of a time from the even raster, in sample intervals per sample interval."""


@dataclass(frozen=True)
class _Ordered:
    """An array with its axes in the order (split, join..., sample, channel)."""

    label: str
    values: NDArray[np.floating]
    headings: tuple[str, ...]

    @property
    def n_split(self) -> int:
        return int(self.values.shape[0])

    @property
    def n_samples(self) -> int:
        return int(np.prod(self.values.shape[1:-1]))

    def column(self, number: int, experiment: int) -> NDArray[np.floating]:
        return self.values[experiment, ..., number].reshape(-1)


def contents(input_path: Path, mapping: RecordingMapping) -> Iterator[Content]:
    """One content for every entry of the split axis, or just one.

    Raises
    ------
    InputError, FileFormatError
        An array, column or file is missing; unequal lengths; axes that do not fit; uneven times; samples not finite.
    """
    files: dict[Path, ArrayFile] = {}
    arrays = {
        key: _ordered(key, input_path, mapping, files) for key in dict.fromkeys(c.array for c in mapping.channels)
    }
    columns = [_column_number(channel, arrays[channel.array]) for channel in mapping.channels]
    _require_equal_lengths(arrays)
    rate, start = _clock(input_path, mapping, files)
    described = StreamDescription(mapping.stream, rate, start, tuple(c.channel() for c in mapping.channels))
    dtype = np.dtype(mapping.dtype or np.result_type(np.float32, *(a.values.dtype for a in arrays.values())))
    first = next(iter(arrays.values()))
    for experiment in range(first.n_split):
        samples = np.empty((first.n_samples, len(columns)), dtype)
        for target, (channel, number) in enumerate(zip(mapping.channels, columns, strict=True)):
            samples[:, target] = channel.to_si(arrays[channel.array].column(number, experiment))
        title = mapping.title if mapping.split is None else f"{mapping.title} {mapping.split} {experiment + 1}".strip()
        yield Content((ArraySamples(described, samples),), title, mapping.setup, mapping.recorded_at)


def _found(
    key: str | None, input_path: Path, mapping: RecordingMapping, files: dict[Path, ArrayFile]
) -> tuple[ArrayFile, str]:
    """The file of an array and the array's name in it."""
    listed = mapping.arrays.get(key or "", ArrayMapping())
    path = _path(listed, input_path)
    if path not in files:
        files[path] = open_arrays(path, **mapping.csv.model_dump())
    file = files[path]
    name = listed.name or (key if key in file.fields or key not in mapping.arrays else None)
    if name is None and len(file.fields) == 1:
        name = next(iter(file.fields))
    return file, name or ""


def _path(listed: ArrayMapping, input_path: Path) -> Path:
    if listed.file is None:
        return input_path
    if isinstance(listed.file, str):
        return input_path.parent / listed.file
    change = listed.file
    if change.replace not in input_path.name:
        raise InputError(f"the input's name {input_path.name} holds no {change.replace!r} to replace by {change.by!r}")
    return input_path.with_name(input_path.name.replace(change.replace, change.by, 1))


def _ordered(key: str | None, input_path: Path, mapping: RecordingMapping, files: dict[Path, ArrayFile]) -> _Ordered:
    file, name = _found(key, input_path, mapping, files)
    values = file.array(name or None)
    listed = mapping.arrays.get(key or "", ArrayMapping())
    label = f"array {name} of {file.path.name}"
    axes = listed.axes or mapping.axes or _usual_axes(values, label)
    if len(axes) != values.ndim:
        raise FileFormatError(f"{label} has shape {values.shape} but axes {', '.join(axes)}; name one axis a dimension")
    wanted = [*([mapping.split] if mapping.split else []), *mapping.join, "sample", "channel"]
    absent = [axis for axis in wanted[:-2] if axis not in axes]
    if absent:
        raise InputError(f"{label} has axes {', '.join(axes)}, without {', '.join(absent)} of join or split; add it")
    if "channel" not in axes:
        values, axes = values[..., np.newaxis], (*axes, "channel")
    values = np.transpose(values, [axes.index(axis) for axis in wanted])
    return _Ordered(label, values if mapping.split else values[np.newaxis], file.headings)


def _usual_axes(values: NDArray[np.floating], label: str) -> tuple[str, ...]:
    """One column a channel; a single row, as MATLAB likes it, is one channel."""
    if values.ndim == 1:
        return ("sample",)
    if values.ndim == 2:
        return ("channel", "sample") if values.shape[0] == 1 and values.shape[1] > 1 else ("sample", "channel")
    raise FileFormatError(f"{label} has {values.ndim} dimensions; name them in axes, such as ['sample', 'channel']")


def _column_number(channel: ChannelMapping, array: _Ordered) -> int:
    """Counted from zero."""
    n_columns, column = int(array.values.shape[-1]), channel.column
    if isinstance(column, int) and column <= n_columns:
        return column - 1
    if isinstance(column, str) and column in array.headings:
        return array.headings.index(column)
    if column is None and n_columns == 1:
        return 0
    known = f"headings {', '.join(array.headings)}" if array.headings else "no headings"
    raise InputError(
        f"channel {channel.name}: column = {column!r} does not pick one of the {n_columns} columns of {array.label} "
        f"({known}); give a number from 1 to {n_columns} or a heading"
    )


def _require_equal_lengths(arrays: dict[str | None, _Ordered]) -> None:
    if len({(a.n_split, a.n_samples) for a in arrays.values()}) > 1:
        found = ", ".join(f"{a.label}: {a.n_split} x {a.n_samples} samples" for a in arrays.values())
        raise FileFormatError(f"arrays of unequal lengths ({found}); cut them to one length")


def _clock(input_path: Path, mapping: RecordingMapping, files: dict[Path, ArrayFile]) -> tuple[float, float]:
    """Sample rate in Hz and time of the first sample in s."""
    if isinstance(mapping.sample_rate, str):
        return _stored_rate(mapping.sample_rate, input_path, mapping, files), mapping.start_time
    if mapping.sample_rate is not None:
        return mapping.sample_rate, mapping.start_time
    if mapping.time is None:
        stated = {file.sample_rate for file in files.values()} - {None}
        if len(stated) != 1:
            raise InputError(
                "the mapping must give either sample_rate (Hz) or time (name of the array or column of times); "
                "add one of them"
            )
        return float(next(iter(stated)) or 0.0), mapping.start_time
    asked = mapping.time or ""
    table = files.get(input_path)
    if table is not None and asked in table.headings:
        times = table.array(None)[:, table.headings.index(asked)]
    else:
        file, name = _found(asked, input_path, mapping, files)
        times = file.array(name).reshape(-1)
    times = np.asarray(times, dtype=float) * _SECONDS[mapping.time_unit]
    if len(times) < 2 or not np.isfinite(times).all() or times[-1] <= times[0]:
        raise FileFormatError(f"time {asked}: needs two or more rising, finite times; give sample_rate instead")
    step = (times[-1] - times[0]) / (len(times) - 1)
    departure = np.abs(np.diff(times) / step - 1)
    if departure.max() > _UNEVEN:
        row = int(departure.argmax())
        raise FileFormatError(
            f"time {asked} is not evenly spaced: {times[row + 1] - times[row]:.6g} s after row {row + 1}, "
            f"{step:.6g} s on average; resample the data or give sample_rate"
        )
    return float(_tidy(1 / step)), float(times[0] + mapping.start_time)


def _stored_rate(name: str, input_path: Path, mapping: RecordingMapping, files: dict[Path, ArrayFile]) -> float:
    """Sample rate that stands in the file under a name."""
    file, found = _found(name, input_path, mapping, files)
    if (found or name) not in file.fields:
        there = ", ".join(file.fields)
        raise FileFormatError(
            f"sample_rate = {name!r}: {file.path.name} has no such array ({there}); give Hz as a number"
        )
    values = file.array(found or name).reshape(-1)
    if len(values) != 1 or not (np.isfinite(values[0]) and values[0] > 0):
        shown = f"{len(values)} numbers" if len(values) != 1 else f"{values[0]:g}"
        raise FileFormatError(f"sample_rate = {name!r}: {file.path.name} holds {shown} there; name one rate in Hz")
    return float(values[0])


def _tidy(rate: float) -> float:
    """Times printed with few digits give 999.99999 Hz where 1000 Hz are meant."""
    return round(rate) if abs(rate - round(rate)) < 1e-6 * rate else rate


def convert(
    input_path: str | os.PathLike[str],
    output_path: str | os.PathLike[str],
    mapping_path: str | os.PathLike[str] | None = None,
    progress: Callable[[int], None] | None = None,
    *,
    span: tuple[float, float] | None = None,
    provenance: str = "",
) -> list[Path]:
    """Convert by suffix: ``.h5 .npz .npy .mat .csv`` into ``.h5 .npz .mat .csv``.

    Parameters
    ----------
    input_path
        A recording, a file written by this function, or, with a mapping, one of another program.
    output_path
        File to write; with ``split`` in the mapping ``rec.h5`` becomes ``rec-1.h5``, ``rec-2.h5`` ...
    mapping_path
        TOML file that says which array or column is which channel, see :class:`RecordingMapping`.
    progress
        Called with the number of samples written so far in the file at hand.
    span : s
        First and last time to keep, counted from the first sample; None: all.
    provenance
        Where the output comes from, as JSON text; every kind of file keeps it.

    Returns
    -------
    list[Path]
        The files written; all of them appear, whole, or none.

    Raises
    ------
    InputError, FileFormatError
        What is given cannot be used; nothing is written.
    """
    source, target = Path(input_path), Path(output_path)
    require_writable(target)
    if not source.is_file():
        raise InputError(f"no file {source}; check the name")
    written: list[Path] = []
    with ExitStack() as stack, _contents(source, mapping_path) as (found, several):
        for number, content in enumerate(found, 1):
            path = target.with_name(f"{target.stem}-{number}{target.suffix}") if several else target
            if path.exists() and path.samefile(source):
                raise InputError(f"{path} is the input itself; choose another output name")
            kept = content if span is None else part_of(content, span)
            told = replace(kept, provenance=provenance)
            write_content(told, stack.enter_context(writing_whole_file(path)), progress)
            written.append(path)
    return written


@contextmanager
def _contents(source: Path, mapping_path: str | os.PathLike[str] | None) -> Iterator[tuple[Iterator[Content], bool]]:
    """Contents found in the file, and whether there may be several."""
    if mapping_path is not None:
        mapping = load_mapping(mapping_path)
        yield contents(source, mapping), mapping.split is not None
    elif source.suffix.lower() in (".h5", ".hdf5"):
        with Recording(source) as recording:
            yield iter([recording_content(recording)]), False
    else:
        yield iter([_self_described(source)]), False


def _self_described(source: Path) -> Content:
    """Content of an NPZ, MAT or CSV file that this program wrote."""
    if source.suffix.lower() == ".csv" and describes_itself(source):
        return read_own_csv(source)
    fields = {} if source.suffix.lower() in (".csv", ".txt", ".npy") else open_arrays(source).fields
    if "format" not in fields:
        raise FileFormatError(
            f"{source} does not say what its channels are; give a mapping file (--map map.toml), which this command "
            f"begins: millfrf new mapping {source.name} --out map.toml (for FRFs: one with [frf])"
        )
    return from_fields(fields, source)
