"""Writers of recordings as HDF5, NPZ, MAT and CSV files."""

import csv
import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, require_memory

from ..recordings.recording_format import FORMAT, FORMAT_VERSION, check_format, stream_from_attributes
from ..recordings.recording_writer import RecordingWriter
from ..sources.source import EventAxis, Events
from .content import ArraySamples, Content, Pairs, Samples, row_blocks

FlatFields = dict[str, Any]


def to_fields(content: Content) -> FlatFields:
    """Flatten: ``samples``, ``sample_rate``, ``channels`` (JSON) ...; further streams carry ``_2``, ``_3``.

    Every name is a valid MATLAB variable.
    """
    samples = {name: one.read().astype(one.dtype) for name, one in tables_of(content).items()}
    return described_fields(content) | samples


def tables_of(content: Content) -> dict[str, Samples]:
    """Samples of each stream by the name of their field; they are not read yet."""
    return {f"samples{_ending(number)}": samples for number, samples in enumerate(content.streams)}


def described_fields(content: Content) -> FlatFields:
    """Everything that :func:`to_fields` gives, but the samples."""
    fields: FlatFields = {
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
        end = _ending(number)
        described = samples.description
        fields[f"stream{end}"] = described.name
        fields[f"sample_rate{end}"] = described.sample_rate
        fields[f"start_time{end}"] = described.start_time
        fields[f"channels{end}"] = json.dumps([channel.to_json() for channel in described.channels])
        fields[f"clock{end}"] = content.clock_pairs.get(described.name, np.empty((0, 2)))
    for number, series in enumerate(content.events.values()):
        fields[f"event_time{_ending(number)}"], fields[f"event_value{_ending(number)}"] = series
    return fields


def from_fields(fields: Mapping[str, Any], path: object) -> Content:
    """Read what :func:`to_fields` gave, after a trip through NPZ or MAT.

    Raises
    ------
    FileFormatError
        Another format or version, or a field is missing or damaged.
    """
    texts = {name: _text(fields.get(name, "")) for name in ("format", "title", "recorded_at", "setup")}
    check_format({"format": texts["format"], "format_version": _whole_number(fields.get("format_version"))}, path)
    streams: list[Samples] = []
    clocks: dict[str, NDArray[np.float64]] = {}
    while f"samples{_ending(len(streams))}" in fields:
        end = _ending(len(streams))
        samples = _stream(fields, end, path)
        streams.append(samples)
        clocks[samples.description.name] = _clock(fields.get(f"clock{end}", ()), path)
    if not streams:
        raise FileFormatError(f"{path} holds no array 'samples'; convert the recording anew")
    events = _events(fields, path)
    notes = event_texts(_json(fields, "event_texts", "{}", path), events, path)
    return Content(tuple(streams), texts["title"], texts["setup"], texts["recorded_at"], events, clocks, notes)


def numbers(value: Any, name: str, path: object) -> NDArray[np.floating]:
    """``value`` as an array of floats, float32 kept.

    Raises
    ------
    FileFormatError
        Complex numbers, texts or objects.
    """
    array = np.asarray(value)
    if array.dtype.kind == "c":
        raise FileFormatError(f"{path}: array {name} is complex; samples are real numbers, convert time series only")
    if array.dtype.kind not in "fiub":
        raise FileFormatError(f"{path}: array {name} holds {array.dtype.name}, not numbers; name another array")
    return array if array.dtype in (np.float32, np.float64) else array.astype(float)


def _ending(number: int) -> str:
    return "" if number == 0 else f"_{number + 1}"


def _stream(fields: Mapping[str, Any], end: str, path: object) -> ArraySamples:
    array = numbers(fields[f"samples{end}"], f"samples{end}", path)
    if array.ndim != 2:
        raise FileFormatError(f"{path}: samples{end} has shape {array.shape}, expected (n_samples, n_channels)")
    attributes: dict[str, Any] = {"channels": _text(fields.get(f"channels{end}", ""))}
    for name in ("sample_rate", "start_time"):
        value = numbers(fields.get(f"{name}{end}", ()), f"{name}{end}", path)
        if value.size == 1:
            attributes[name] = float(value.reshape(-1)[0])
    name = _text(fields.get(f"stream{end}", "")) or "main"
    return ArraySamples(stream_from_attributes(name, attributes, array.shape[1], path), array)


def _clock(value: Any, path: object) -> NDArray[np.float64]:
    pairs = numbers(value, "clock", path).astype(float)
    if pairs.size % 2:
        raise FileFormatError(f"{path}: array clock of shape {pairs.shape} does not hold pairs; convert anew")
    return pairs.reshape(-1, 2)


def _events(fields: Mapping[str, Any], path: object) -> dict[str, Pairs]:
    names = _json(fields, "event_names", "[]", path)
    events = {}
    for number, name in enumerate(names):
        pair = [
            numbers(fields.get(f"{column}{_ending(number)}", ()), f"events {name}", path).astype(float).reshape(-1)
            for column in ("event_time", "event_value")
        ]
        if pair[0].size != pair[1].size:
            raise FileFormatError(f"{path}: events {name} have {pair[0].size} times but {pair[1].size} values")
        events[str(name)] = (pair[0], pair[1])
    return events


def event_texts(stored: Any, events: Mapping[str, Pairs], path: object) -> dict[str, tuple[str, ...]]:
    """Texts by series, one a value.

    Raises
    ------
    FileFormatError
        Series that are not there, or not as many texts as values.
    """
    found = stored if isinstance(stored, dict) else {}
    for name, texts in found.items():
        if name not in events or not isinstance(texts, list) or len(texts) != len(events[name][0]):
            raise FileFormatError(
                f"{path}: event_texts of {name!r} do not match its values; convert the recording anew"
            )
    return {str(name): tuple(map(str, texts)) for name, texts in found.items()}


def _json(fields: Mapping[str, Any], name: str, otherwise: str, path: object) -> Any:
    try:
        return json.loads(_text(fields.get(name, "")) or otherwise)
    except (json.JSONDecodeError, RecursionError) as error:
        raise FileFormatError(f"{path}: {name} is not JSON ({error}); convert the recording anew") from error


def _text(value: Any) -> str:
    array = np.asarray(value)
    return "" if array.size == 0 else str(array.reshape(-1)[0])


def _whole_number(value: Any) -> int | None:
    array = np.asarray(value)
    whole = array.size == 1 and array.dtype.kind in "iuf" and float(array.reshape(-1)[0]).is_integer()
    return int(array.reshape(-1)[0]) if whole else None


Progress = Callable[[int], None]

SPARE_BYTES = 1_000_000
"""Disk space kept aside so that the HDF5 library can close its file in order on a full disk."""

_BYTES_A_MAT_VALUE = 16.0  # seen at the peak
_LARGEST_MAT_ARRAY = 2**31 - 1


def write_content(content: Content, path: Path, progress: Progress | None = None) -> None:
    """Write ``content`` in the format that the suffix of ``path`` names.

    Raises
    ------
    InputError
        A suffix that cannot be written, or content that the format cannot hold.
    """
    require_writable(path)
    report: Progress = progress or (lambda n_samples: None)
    {".h5": _write_h5, ".npz": _write_npz, ".mat": _write_mat, ".csv": _write_csv}[path.suffix.lower()](
        content, path, report
    )


def require_writable(path: Path) -> None:
    """Refuse a suffix that :func:`write_content` does not know."""
    if path.suffix.lower() not in (".h5", ".npz", ".mat", ".csv"):
        raise InputError(f"cannot write {path.name}: suffix {path.suffix!r}; use .h5, .npz, .mat or .csv")


def _write_h5(content: Content, path: Path, progress: Progress) -> None:
    described = [samples.description for samples in content.streams]
    dtype: Literal["float32", "float64"] = "float32"
    if any(samples.dtype == np.float64 for samples in content.streams):
        dtype = "float64"
    with RecordingWriter(
        path,
        described,
        title=content.title,
        setup=content.setup,
        dtype=dtype,
        event_axes={name: EventAxis(texts=name in content.event_texts) for name in content.events},
        recorded_at=content.recorded_at,
        provenance=content.provenance,
        overwrite=True,
        spare_bytes=SPARE_BYTES,
    ) as writer:
        written = 0
        for samples in content.streams:
            for block in row_blocks(samples):
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
    """As `numpy.savez` writes it, with the samples block by block."""
    written = 0
    with zipfile.ZipFile(path, "w", allowZip64=True) as archive:
        for name, value in described_fields(content).items():
            with archive.open(f"{name}.npy", "w") as entry:
                np.lib.format.write_array(entry, np.asarray(value), allow_pickle=False)
        for name, samples in tables_of(content).items():
            shape = (samples.n_samples, len(samples.description.channels))
            header = {"descr": samples.dtype.str, "fortran_order": False, "shape": shape}
            with archive.open(f"{name}.npy", "w", force_zip64=True) as entry:
                np.lib.format.write_array_header_1_0(entry, header)
                for block in row_blocks(samples):
                    entry.write(block.astype(samples.dtype).tobytes())
                    written += len(block)
                    progress(written)


def _write_mat(content: Content, path: Path, progress: Progress) -> None:
    for samples in content.streams:
        size = samples.n_samples * len(samples.description.channels) * samples.dtype.itemsize
        if size > _LARGEST_MAT_ARRAY:
            raise InputError(f"stream {samples.description.name} has {size} bytes, more than a MAT file holds; use .h5")
        require_memory(
            _BYTES_A_MAT_VALUE * size / samples.dtype.itemsize,
            f"{path.name}, a MAT file of {size / 1e6:.0f} MB, which is written at once",
            "write .h5, which MATLAB reads with h5read, or a part with --span",
        )
    with path.open("wb") as handle:
        scipy.io.savemat(handle, to_fields(content), oned_as="column")
    progress(_total(content))


def _total(content: Content) -> int:
    return sum(samples.n_samples for samples in content.streams)


def _write_csv(content: Content, path: Path, progress: Progress) -> None:
    if len(content.streams) != 1:
        names = ", ".join(samples.description.name for samples in content.streams)
        raise InputError(f"a CSV file holds one sample clock, this recording has {names}; use .npz, .mat or .h5")
    samples = content.streams[0]
    described = samples.description
    digits = "%.9g" if samples.dtype == np.float32 else "%.17g"
    row_format = ",".join(["%.15g", *[digits] * len(described.channels)])
    with path.open("w", encoding="utf-8", newline="\n") as handle:
        for key, value in _csv_metadata(content).items():
            handle.write(f"# {key}: {json.dumps(value)}\n")
        headings = ["time [s]", *(f"{channel.name} [{channel.unit}]" for channel in described.channels)]
        csv.writer(handle, lineterminator="\n").writerow(headings)
        written = 0
        for block in row_blocks(samples):
            time = described.start_time + np.arange(written, written + len(block)) / described.sample_rate
            np.savetxt(handle, np.column_stack([time, block]), fmt=row_format)
            written += len(block)
            progress(written)


def _csv_metadata(content: Content) -> dict[str, object]:
    samples = content.streams[0]
    described = samples.description

    def listed(pairs: tuple[NDArray[np.float64], NDArray[np.float64]]) -> list[list[float]]:
        return [pairs[0].tolist(), pairs[1].tolist()]

    return {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        "title": content.title,
        "recorded_at": content.recorded_at,
        "setup": content.setup,
        "provenance": json.loads(content.provenance or "{}"),
        "stream": described.name,
        "sample_rate": described.sample_rate,
        "start_time": described.start_time,
        "dtype": samples.dtype.name,
        "channels": [channel.to_json() for channel in described.channels],
        "events": {name: listed(pairs) for name, pairs in content.events.items()},
        "event_texts": {name: list(texts) for name, texts in content.event_texts.items()},
        "clock": content.clock_pairs.get(described.name, np.empty((0, 2))).tolist(),
    }
