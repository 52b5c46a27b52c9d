"""Put a recording together from arrays and a mapping."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError, InputError

from ..sources import StreamDescription
from .array_file import ArrayFile, open_arrays
from .content import ArraySamples, Content
from .mapping import ArrayMapping, ChannelMapping, RecordingMapping

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
