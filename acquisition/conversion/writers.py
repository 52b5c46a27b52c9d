"""Writers of recordings as HDF5, NPZ, MAT and CSV files."""

import csv
import hashlib
import io
import json
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy

from millfrf.core import (
    FileFormatError,
    InputError,
    Real,
    harmless,
    require_memory,
    side_file,
    side_note,
    side_text,
    writing_whole_file,
)
from millfrf.core.runtime import notice

from ..recordings.recording_format import FORMAT, FORMAT_VERSION, check_format, stream_from_attributes
from ..recordings.recording_writer import RecordingWriter
from ..settings import SETTINGS
from ..sources.source import EventAxis, Events
from .array_file import float_array
from .content import Content, Pairs, Samples, samples_of_array
from .text_lines import TextOptions, lines_of
from .text_table import read_text_table

Progress = Callable[[int], None]


def _suffix(number: int) -> str:
    """Return the suffix of the field names of a stream or series: none, ``_2``, ``_3`` ..."""
    return "" if number == 0 else f"_{number + 1}"


def _sample_fields(content: Content) -> dict[str, Samples]:
    """Return the samples of each stream by the name of their field in an NPZ or MAT file."""
    return {f"samples{_suffix(number)}": samples for number, samples in enumerate(content.streams)}


def _described_fields(content: Content) -> dict[str, Any]:
    """Return all fields of an NPZ or MAT file except the samples; every name is a valid variable of MATLAB."""
    fields: dict[str, Any] = {
        "format": FORMAT,
        "format_version": 1,
        "title": content.title,
        "recorded_at": content.recorded_at,
        "setup": content.setup,
        "provenance": content.provenance,
        "event_names": json.dumps(list(content.events)),
        "event_texts": json.dumps({name: list(texts) for name, texts in content.event_texts.items()}),
    }
    for number, samples in enumerate(content.streams):
        suffix, stream = _suffix(number), samples.description
        fields[f"stream{suffix}"] = stream.name
        fields[f"sample_rate{suffix}"] = stream.sample_rate
        fields[f"start_time{suffix}"] = stream.start_time
        fields[f"channels{suffix}"] = json.dumps([channel.to_json() for channel in stream.channels])
        fields[f"clock{suffix}"] = content.clock_pairs.get(stream.name, np.empty((0, 2)))
    for number, series in enumerate(content.events.values()):
        fields[f"event_time{_suffix(number)}"], fields[f"event_value{_suffix(number)}"] = series
    return fields


def from_fields(fields: Mapping[str, Any], path: object) -> Content:
    """Make the content from the fields of an NPZ or MAT file that this program wrote."""
    texts = {name: _text(fields.get(name, "")) for name in ("format", "title", "recorded_at", "setup")}
    check_format({"format": texts["format"], "format_version": _whole_number(fields.get("format_version"))}, path)
    streams: list[Samples] = []
    clocks: dict[str, Real] = {}
    while f"samples{_suffix(len(streams))}" in fields:
        suffix = _suffix(len(streams))
        samples = _samples(fields, suffix, path)
        streams.append(samples)
        clocks[samples.description.name] = _clock_pairs(fields.get(f"clock{suffix}", ()), path)
    if not streams:
        raise FileFormatError(f"{path} holds no array 'samples'; convert the recording again")
    events = _events(fields, path)
    notes = event_texts(_json(fields, "event_texts", "{}", path), events, path)
    return Content(tuple(streams), texts["title"], texts["setup"], texts["recorded_at"], events, clocks, notes)


def _samples(fields: Mapping[str, Any], suffix: str, path: object) -> Samples:
    array = float_array(fields[f"samples{suffix}"], f"samples{suffix}", path)
    if array.ndim != 2:
        raise FileFormatError(f"{path}: samples{suffix} has shape {array.shape}, expected (n_samples, n_channels)")
    attributes: dict[str, Any] = {"channels": _text(fields.get(f"channels{suffix}", ""))}
    for name in ("sample_rate", "start_time"):
        value = float_array(fields.get(f"{name}{suffix}", ()), f"{name}{suffix}", path)
        if value.size == 1:
            attributes[name] = float(value.reshape(-1)[0])
    name = _text(fields.get(f"stream{suffix}", "")) or "main"
    return samples_of_array(stream_from_attributes(name, attributes, array.shape[1], path), array, with_gaps=True)


def _clock_pairs(value: Any, path: object) -> Real:
    pairs = float_array(value, "clock", path).astype(float)
    if pairs.size % 2:
        raise FileFormatError(f"{path}: array clock of shape {pairs.shape} does not hold pairs; convert it again")
    return pairs.reshape(-1, 2)


def _events(fields: Mapping[str, Any], path: object) -> dict[str, Pairs]:
    events = {}
    for number, name in enumerate(_json(fields, "event_names", "[]", path)):
        times, values = (
            float_array(fields.get(f"{column}{_suffix(number)}", ()), f"events {name}", path).astype(float).reshape(-1)
            for column in ("event_time", "event_value")
        )
        if times.size != values.size:
            raise FileFormatError(f"{path}: events {name} have {times.size} times but {values.size} values")
        events[str(name)] = (times, values)
    return events


def event_texts(stored: Any, events: Mapping[str, Pairs], path: object) -> dict[str, tuple[str, ...]]:
    """Check the texts of events by series and return them; refuse texts that do not match the values."""
    by_series = stored if isinstance(stored, dict) else {}
    for name, texts in by_series.items():
        if name not in events or not isinstance(texts, list) or len(texts) != len(events[name][0]):
            raise FileFormatError(
                f"{path}: event_texts of {name!r} do not match its values; convert the recording again"
            )
    return {str(name): tuple(map(str, texts)) for name, texts in by_series.items()}


def _json(fields: Mapping[str, Any], name: str, default: str, path: object) -> Any:
    try:
        return json.loads(_text(fields.get(name, "")) or default)
    except (json.JSONDecodeError, RecursionError) as error:
        raise FileFormatError(f"{path}: {name} is not JSON ({error}); convert the recording again") from error


def _text(value: Any) -> str:
    array = np.asarray(value)
    return "" if array.size == 0 else str(array.reshape(-1)[0])


def _whole_number(value: Any) -> int | None:
    array = np.asarray(value)
    is_whole = array.size == 1 and array.dtype.kind in "iuf" and float(array.reshape(-1)[0]).is_integer()
    return int(array.reshape(-1)[0]) if is_whole else None


def require_writable(path: Path) -> None:
    """Refuse a suffix that :func:`written_content` does not know."""
    if path.suffix.lower() not in (".h5", ".npz", ".mat", ".csv"):
        raise InputError(f"cannot write {path.name}: suffix {path.suffix!r}; use .h5, .npz, .mat or .csv")


@contextmanager
def written_content(content: Content, path: Path, progress: Progress | None = None) -> Iterator[None]:
    """Write ``content`` in the format that the suffix of ``path`` names; the file appears when the context ends."""
    require_writable(path)
    report: Progress = progress or (lambda n_samples: None)
    suffix = path.suffix.lower()
    if suffix == ".csv":  # of two whole files the table is the last to appear
        with writing_whole_file(path) as table, writing_whole_file(side_file(path)) as side:
            side.write_text(_write_csv(content, table, path.name, report), encoding="utf-8")
            yield
        return
    with writing_whole_file(path) as temporary:
        {".h5": _write_h5, ".npz": _write_npz, ".mat": _write_mat}[suffix](content, temporary, report)
        yield


def _write_h5(content: Content, path: Path, progress: Progress) -> None:
    needs_double = any(samples.dtype == np.float64 for samples in content.streams)
    dtype: Literal["float32", "float64"] = "float64" if needs_double else "float32"
    with RecordingWriter(
        path,
        [samples.description for samples in content.streams],
        title=content.title,
        setup=content.setup,
        dtype=dtype,
        event_axes={name: EventAxis(texts=name in content.event_texts) for name in content.events},
        recorded_at=content.recorded_at,
        provenance=content.provenance,
        overwrite=True,
        spare_bytes=SETTINGS.copy_spare_bytes,
    ) as writer:
        written = 0
        for samples in content.streams:
            for block in samples.blocks():
                if np.isfinite(block).all():
                    writer.append(samples.description.name, block)
                else:
                    writer.append_with_missing(samples.description.name, block, "missing in the recording it is from")
                written += len(block)
                progress(written)
        for name, (times, values) in content.events.items():
            writer.append_events(Events(name, times, values, None, content.event_texts.get(name)))
        for name, pairs in content.clock_pairs.items():
            if len(pairs):
                writer.append_clock_pairs(name, np.asarray(pairs, dtype=float))


def _write_npz(content: Content, path: Path, progress: Progress) -> None:
    """Write the samples block by block to a file of the same form as `numpy.savez` writes."""
    written = 0
    with zipfile.ZipFile(path, "w", allowZip64=True) as archive:
        for name, value in _described_fields(content).items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asarray(value), allow_pickle=False)
        for name, samples in _sample_fields(content).items():
            shape = (samples.n_samples, len(samples.description.channels))
            header = {"descr": samples.dtype.str, "fortran_order": False, "shape": shape}
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array_header_1_0(entry, header)
                for block in samples.blocks():
                    entry.write(block.astype(samples.dtype).tobytes())
                    written += len(block)
                    progress(written)


def _write_mat(content: Content, path: Path, progress: Progress) -> None:
    largest_size = 2**31 - 1  # bytes of an array in a MAT file
    for samples in content.streams:
        n_values = samples.n_samples * len(samples.description.channels)
        size = n_values * samples.dtype.itemsize
        if size > largest_size:
            raise InputError(f"stream {samples.description.name} has {size} bytes, more than a MAT file holds; use .h5")
        require_memory(
            SETTINGS.mat_bytes_per_value * n_values,
            f"{path.name}, a MAT file of {size / 1e6:.0f} MB, which is written at once",
            "write .h5, which MATLAB reads with h5read, or a part with --span",
        )
    arrays = {
        name: samples.read(0, samples.n_samples).astype(samples.dtype)
        for name, samples in _sample_fields(content).items()
    }
    with path.open("wb") as handle:
        scipy.io.savemat(handle, _described_fields(content) | arrays, oned_as="column")
    progress(sum(samples.n_samples for samples in content.streams))


def _write_csv(content: Content, path: Path, name: str, progress: Progress) -> str:
    """Write the table, and return the text of the side file that describes it under its name."""
    if len(content.streams) != 1:
        names = ", ".join(samples.description.name for samples in content.streams)
        raise InputError(f"a CSV file holds one sample clock, this recording has {names}; use .npz, .mat or .h5")
    samples = content.streams[0]
    headings = ["time [s]", *(f"{channel.name} [{channel.unit}]" for channel in samples.description.channels)]
    first = io.StringIO()
    csv.writer(first, lineterminator="\n").writerow(map(harmless, headings))
    digest = hashlib.sha256()
    with path.open("wb") as handle:
        for text, written in chain([(first.getvalue(), 0)], _csv_rows(samples)):
            data = text.encode("utf-8")
            digest.update(data)
            handle.write(data)
            if written:  # the heading has no samples
                progress(written)
    note = {
        "sha256": digest.hexdigest(),
        "warnings": [],
        "provenance": json.loads(content.provenance or "{}"),
        "recording": _csv_metadata(content),
    }
    return side_text(name, headings, ["double"] * len(headings), note)


def _csv_rows(samples: Samples) -> Iterator[tuple[str, int]]:
    """Yield the rows of a table block by block as text, and the number of rows so far."""
    stream = samples.description
    digits = "%.9g" if samples.dtype == np.float32 else "%.17g"  # digits that determine each value exactly
    written = 0
    for block in samples.blocks():
        time = stream.start_time + np.arange(written, written + len(block)) / stream.sample_rate
        text = io.StringIO()
        np.savetxt(text, np.column_stack([time, block]), fmt=",".join(["%.15g", *[digits] * len(stream.channels)]))
        written += len(block)
        yield text.getvalue(), written


def _csv_metadata(content: Content) -> dict[str, object]:
    samples = content.streams[0]
    stream = samples.description
    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "title": content.title,
        "recorded_at": content.recorded_at,
        "setup": content.setup,
        "stream": stream.name,
        "sample_rate": stream.sample_rate,
        "start_time": stream.start_time,
        "dtype": samples.dtype.name,
        "channels": [channel.to_json() for channel in stream.channels],
        "events": {name: [times.tolist(), values.tolist()] for name, (times, values) in content.events.items()},
        "event_texts": {name: list(texts) for name, texts in content.event_texts.items()},
        "clock": content.clock_pairs.get(stream.name, np.empty((0, 2))).tolist(),
    }


def own_csv_metadata(path: Path) -> dict[str, Any]:
    """Return the description of a recording in a CSV file that this program wrote; empty for any other file.

    It is in the side file, or in lines ``# key: value`` at the beginning of the table, as earlier versions wrote them.
    """
    note, doubts = side_note(path)
    if isinstance(note.get("recording"), dict):
        for doubt in doubts:
            notice(doubt)
        return dict(note["recording"])
    with path.open("rb") as handle:
        if not handle.readline(200).startswith(b"# format: "):
            return {}
    metadata: dict[str, Any] = {}
    for line in lines_of(path, "utf-8-sig"):
        if not line.startswith("# "):
            break
        key, _, value = line[2:].partition(": ")
        try:
            metadata[key] = json.loads(value)
        except json.JSONDecodeError as error:
            raise FileFormatError(f"{path}: comment line {key!r} is not JSON ({error}); convert it again") from error
    return metadata


def read_own_csv(path: Path, metadata: Mapping[str, Any]) -> Content:
    """Read a CSV file that this program wrote, with its description."""
    check_format(metadata, path)
    options = TextOptions(delimiter=",", decimal=".", encoding="utf-8-sig")
    values = read_text_table(path, options).values[:, 1:]  # the first column is time
    attributes = {**metadata, "channels": json.dumps(metadata.get("channels"))}
    stream = stream_from_attributes(str(metadata.get("stream", "main")), attributes, values.shape[1], path)
    dtype = np.float32 if metadata.get("dtype") == "float32" else np.float64
    samples = samples_of_array(stream, values.astype(dtype, copy=False), with_gaps=True)
    try:
        events = {
            name: (np.array(times, dtype=float), np.array(series, dtype=float))
            for name, (times, series) in metadata.get("events", {}).items()
        }
        clock = np.array(metadata.get("clock", []), dtype=float).reshape(-1, 2)
    except (TypeError, ValueError, AttributeError) as error:
        raise FileFormatError(f"{path}: its description of events or clock is damaged; convert it again") from error
    texts = event_texts(metadata.get("event_texts"), events, path)
    title, setup, recorded_at = (str(metadata.get(name, "")) for name in ("title", "setup", "recorded_at"))
    return Content((samples,), title, setup, recorded_at, events, {stream.name: clock}, texts)
