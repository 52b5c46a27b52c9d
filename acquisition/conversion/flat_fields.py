"""A recording as named arrays and texts: what an NPZ or MAT file written here holds, so that it can be read back."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from foundation import FileFormatError

from ..recordings import FORMAT, check_format, stream_from_attributes
from .content import ArraySamples, Content, Pairs, Samples

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
