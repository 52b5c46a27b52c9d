"""Conversion of recordings from one kind of file into one or several files of another kind."""

import os
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, writing_whole_file

from ..recordings.recording import Recording
from ..settings import SETTINGS
from ..sources.source import StreamDescription
from .array_file import ArrayFile, open_arrays
from .content import Content, between_times, recording_content, samples_of_array
from .csv_file import is_own_csv, read_own_csv
from .mapping import ArrayMapping, ChannelMapping, RecordingMapping, load_mapping
from .writers import from_fields, require_writable, write_content


def convert(
    input_path: str | os.PathLike[str],
    output_path: str | os.PathLike[str],
    mapping_path: str | os.PathLike[str] | None = None,
    progress: Callable[[int], None] | None = None,
    *,
    span: tuple[float, float] | None = None,
    provenance: str = "",
) -> list[Path]:
    """Convert a recording; the suffixes of the files decide: ``.h5 .npz .npy .mat .csv`` into ``.h5 .npz .mat .csv``.

    Parameters
    ----------
    input_path
        A recording, a file written by this function, or, with a mapping, a file of another program.
    output_path
        File to write; with ``split`` in the mapping ``rec.h5`` becomes ``rec-1.h5``, ``rec-2.h5`` ...
    mapping_path
        TOML file that states which array or column is which channel, see :class:`RecordingMapping`.
    progress
        Function that is called with the number of samples written so far in the current file.
    span : s
        First and last time to keep, counted from the first sample; None: all.
    provenance
        Origin of the output as JSON text; every kind of file stores it.

    Returns
    -------
    list[Path]
        Paths of the new files. Either all of them are complete, or none is written.

    Raises
    ------
    InputError, FileFormatError
        A file cannot be used; nothing is written.
    """
    source, target = Path(input_path), Path(output_path)
    require_writable(target)
    if not source.is_file():
        raise InputError(f"no file {source}; check the name")
    written: list[Path] = []
    with ExitStack() as stack, _opened_contents(source, mapping_path) as (contents, is_split):
        for number, content in enumerate(contents, 1):
            path = target.with_name(f"{target.stem}-{number}{target.suffix}") if is_split else target
            if path.exists() and path.samefile(source):
                raise InputError(f"{path} is the input itself; choose another output name")
            chosen = content if span is None else between_times(content, span)
            temporary = stack.enter_context(writing_whole_file(path))
            write_content(replace(chosen, provenance=provenance), temporary, progress)
            written.append(path)
    return written


@contextmanager
def _opened_contents(
    source: Path, mapping_path: str | os.PathLike[str] | None
) -> Iterator[tuple[Iterator[Content], bool]]:
    """Open a file; yield its contents, and whether the mapping splits it into several recordings."""
    if mapping_path is not None:
        mapping = load_mapping(mapping_path)
        yield _MappedArrays(source, mapping).contents(), mapping.split is not None
    elif source.suffix.lower() in (".h5", ".hdf5"):
        with Recording(source) as recording:
            yield iter([recording_content(recording)]), False
    else:
        yield iter([_self_described(source)]), False


def _self_described(source: Path) -> Content:
    if source.suffix.lower() == ".csv" and is_own_csv(source):
        return read_own_csv(source)
    fields = {} if source.suffix.lower() in (".csv", ".txt", ".npy") else open_arrays(source).fields
    if "format" not in fields:
        raise FileFormatError(
            f"{source} does not say what its channels are; give a mapping file (--map map.toml), which this command "
            f"begins: millfrf new mapping {source.name} --out map.toml (for FRFs: one with [frf])"
        )
    return from_fields(fields, source)


@dataclass(frozen=True)
class _OrderedArray:
    """An array with its axes in the order (split, join..., sample, channel); ``label`` names it in messages."""

    label: str
    values: NDArray[np.floating]
    headings: tuple[str, ...]

    @property
    def n_split(self) -> int:
        return int(self.values.shape[0])

    @property
    def n_samples(self) -> int:
        return int(np.prod(self.values.shape[1:-1]))

    def column_number(self, channel: ChannelMapping) -> int:
        """Return the index of a channel's column, from 0."""
        n_columns, column = int(self.values.shape[-1]), channel.column
        if isinstance(column, int) and column <= n_columns:
            return column - 1
        if isinstance(column, str) and column in self.headings:
            return self.headings.index(column)
        if column is None and n_columns == 1:
            return 0
        known = f"headings {', '.join(self.headings)}" if self.headings else "no headings"
        raise InputError(
            f"channel {channel.name}: column = {column!r} does not pick one of the {n_columns} columns of {self.label} "
            f"({known}); give a number from 1 to {n_columns} or a heading"
        )


class _MappedArrays:
    """Arrays of a file of another program, and of the further files that its mapping names."""

    def __init__(self, input_path: Path, mapping: RecordingMapping) -> None:
        self._input_path = input_path
        self._mapping = mapping
        self._files: dict[Path, ArrayFile] = {}

    def contents(self) -> Iterator[Content]:
        """Yield one content for every entry of the split axis, or a single content."""
        mapping = self._mapping
        arrays = {key: self._ordered(key) for key in dict.fromkeys(channel.array for channel in mapping.channels)}
        columns = [arrays[channel.array].column_number(channel) for channel in mapping.channels]
        if len({(array.n_split, array.n_samples) for array in arrays.values()}) > 1:
            lengths = ", ".join(
                f"{array.label}: {array.n_split} x {array.n_samples} samples" for array in arrays.values()
            )
            raise FileFormatError(f"arrays of unequal lengths ({lengths}); cut them to one length")
        rate, start = self._clock()
        stream = StreamDescription(mapping.stream, rate, start, tuple(c.channel() for c in mapping.channels))
        dtype = np.dtype(mapping.dtype or np.result_type(np.float32, *(a.values.dtype for a in arrays.values())))
        first = next(iter(arrays.values()))
        for part in range(first.n_split):
            samples = np.empty((first.n_samples, len(columns)), dtype)
            for k, (channel, column) in enumerate(zip(mapping.channels, columns, strict=True)):
                samples[:, k] = channel.to_si(arrays[channel.array].values[part, ..., column].reshape(-1))
            title = mapping.title if mapping.split is None else f"{mapping.title} {mapping.split} {part + 1}".strip()
            yield Content((samples_of_array(stream, samples),), title, mapping.setup, mapping.recorded_at)

    def _array_mapping(self, key: str | None) -> ArrayMapping:
        return self._mapping.arrays.get(key or "", ArrayMapping())

    def _find(self, key: str | None) -> tuple[ArrayFile, str]:
        """Return the file of an array, and the name of the array in it, empty if it has none."""
        array = self._array_mapping(key)
        path = self._path(array)
        if path not in self._files:
            self._files[path] = open_arrays(path, **self._mapping.csv.model_dump())
        file = self._files[path]
        name = array.name or (key if key in file.fields or key not in self._mapping.arrays else None)
        if name is None and len(file.fields) == 1:
            name = next(iter(file.fields))
        return file, name or ""

    def _path(self, array: ArrayMapping) -> Path:
        source = self._input_path
        if array.file is None:
            return source
        if isinstance(array.file, str):
            return source.parent / array.file
        change = array.file
        if change.replace not in source.name:
            raise InputError(f"the input's name {source.name} holds no {change.replace!r} to replace by {change.by!r}")
        return source.with_name(source.name.replace(change.replace, change.by, 1))

    def _ordered(self, key: str | None) -> _OrderedArray:
        mapping = self._mapping
        file, name = self._find(key)
        values = file.array(name or None)
        label = f"array {name} of {file.path.name}"
        axes = self._array_mapping(key).axes or mapping.axes or _usual_axes(values, label)
        if len(axes) != values.ndim:
            raise FileFormatError(
                f"{label} has shape {values.shape} but axes {', '.join(axes)}; name one axis per dimension"
            )
        required = [*([mapping.split] if mapping.split else []), *mapping.join]
        missing = [axis for axis in required if axis not in axes]
        if missing:
            raise InputError(
                f"{label} has axes {', '.join(axes)}, without {', '.join(missing)} of join or split; add it"
            )
        if "channel" not in axes:
            values, axes = values[..., np.newaxis], (*axes, "channel")
        values = np.transpose(values, [axes.index(axis) for axis in (*required, "sample", "channel")])
        return _OrderedArray(label, values if mapping.split else values[np.newaxis], file.headings)

    def _clock(self) -> tuple[float, float]:
        """Return sample rate (Hz) and time of the first sample (s)."""
        mapping = self._mapping
        if isinstance(mapping.sample_rate, str):
            return self._stored_rate(mapping.sample_rate), mapping.start_time
        if mapping.sample_rate is not None:
            return mapping.sample_rate, mapping.start_time
        if mapping.time is not None:
            rate, first_time = self._rate_of_times(mapping.time)
            return rate, first_time + mapping.start_time
        rates = {file.sample_rate for file in self._files.values() if file.sample_rate is not None}
        if len(rates) != 1:
            raise InputError(
                "the mapping must give either sample_rate (Hz) or time (name of the array or column of times); "
                "add one of them"
            )
        return float(rates.pop()), mapping.start_time

    def _rate_of_times(self, name: str) -> tuple[float, float]:
        """Return sample rate (Hz) and first time (s) from an array or a column of evenly spaced times."""
        table = self._files.get(self._input_path)
        if table is not None and name in table.headings:
            stored = table.array(None)[:, table.headings.index(name)]
        else:
            file, array_name = self._find(name)
            stored = file.array(array_name).reshape(-1)
        times = np.asarray(stored, dtype=float) * {"s": 1.0, "ms": 1e-3, "us": 1e-6}[self._mapping.time_unit]
        if len(times) < 2 or not np.isfinite(times).all() or times[-1] <= times[0]:
            raise FileFormatError(f"time {name}: needs two or more rising, finite times; give sample_rate instead")
        step = (times[-1] - times[0]) / (len(times) - 1)
        deviation = np.abs(np.diff(times) / step - 1)
        if deviation.max() > SETTINGS.largest_time_deviation:
            row = int(deviation.argmax())
            raise FileFormatError(
                f"time {name} is not evenly spaced: {times[row + 1] - times[row]:.6g} s after row {row + 1}, "
                f"{step:.6g} s on average; resample the data or give sample_rate"
            )
        rate = 1 / step
        if abs(rate - round(rate)) < 1e-6 * rate:  # times printed with few digits give 999.99999 Hz instead of 1000 Hz
            rate = round(rate)
        return float(rate), float(times[0])

    def _stored_rate(self, name: str) -> float:
        file, array_name = self._find(name)
        array_name = array_name or name
        if array_name not in file.fields:
            raise FileFormatError(
                f"sample_rate = {name!r}: {file.path.name} has no such array ({', '.join(file.fields)}); "
                "give Hz as a number"
            )
        values = file.array(array_name).reshape(-1)
        if len(values) != 1 or not (np.isfinite(values[0]) and values[0] > 0):
            content = f"{len(values)} numbers" if len(values) != 1 else f"{values[0]:g}"
            raise FileFormatError(
                f"sample_rate = {name!r}: {file.path.name} holds {content} there; name one rate in Hz"
            )
        return float(values[0])


def _usual_axes(values: NDArray[np.floating], label: str) -> tuple[str, ...]:
    """Return the usual axes: one column per channel, but a single row, as MATLAB stores a vector, is one channel."""
    if values.ndim == 1:
        return ("sample",)
    if values.ndim == 2:
        return ("channel", "sample") if values.shape[0] == 1 and values.shape[1] > 1 else ("sample", "channel")
    raise FileFormatError(f"{label} has {values.ndim} dimensions; name them in axes, such as ['sample', 'channel']")
