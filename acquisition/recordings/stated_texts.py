"""Texts of a recording, compared with their copy in the journal, which has a checksum.

HDF5 stores texts of variable length without a checksum: one changed bit makes ``teeth = 2`` a 3.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from millfrf.core import FileFormatError, command

from ..sources.source import EventAxis, StreamDescription
from .journal import END, JOURNAL_CHUNK, Frame, frames_in, texts_of
from .recording_format import FORMAT, FORMAT_VERSION, text_attribute

_SHOWN = 40  # characters of a text in a message
Attributes = Mapping[str, Mapping[str, Any]]  # by place in the file and name


def stated_texts(
    streams: Sequence[StreamDescription],
    event_axes: Mapping[str, EventAxis],
    texts: Mapping[str, str],
    dtype: str,
    block_length: int,
) -> dict[str, dict[str, dict[str, Any]]]:
    """Return everything that a recording states before its first sample.

    The key ``attributes`` holds the attributes by place in the file, ``tables`` the types of its tables by place.
    """
    attributes: dict[str, dict[str, Any]] = {"/": {"format": FORMAT, "format_version": FORMAT_VERSION, **texts}}
    tables: dict[str, dict[str, Any]] = {}
    for stream in streams:
        attributes[f"/signals/{stream.name}"] = {
            "sample_rate": float(stream.sample_rate),
            "start_time": float(stream.start_time),
            "channels": json.dumps([channel.to_json() for channel in stream.channels]),
        }
        tables[f"/signals/{stream.name}"] = {"dtype": str(np.dtype(dtype)), "chunk_rows": block_length}
    for name, axis in event_axes.items():
        attributes[f"/events/{name}"] = {"time_axis": axis.kind, "clock": axis.clock}
        tables[f"/events/{name}"] = {"texts": axis.texts}
    return {"attributes": attributes, "tables": tables}


def require_stated(file: h5py.File, path: Path, *, is_open: bool) -> None:
    """Refuse a recording of version 3 whose texts differ from their copy, or whose copy is damaged.

    ``is_open`` states that its writer has not closed it yet, or was killed.
    """
    remedy = f"save the recording with the {{}}: {command('recover', path)}"
    first, last = _journal_frames(file)
    copy = texts_of(first)
    if copy is None:
        raise FileFormatError(f"{path}: the copy of its texts is damaged; {remedy.format('texts as they are')}")
    stated = {place: {**values} for place, values in copy["attributes"].items()}
    ends = [json.loads(frame.payload) for frame in last if frame.kind == END]
    end = ends[-1] if ends else {"complete": False, "ending": ""}
    # A writer that closes the file writes the frame before the attributes, and may be killed between.
    is_ending = is_open and not (file.attrs["complete"] or text_attribute(file.attrs, "ending"))
    stated["/"] |= {} if is_ending else end
    if difference := first_difference(file, stated) or _missing_texts(file, copy["tables"]):
        raise FileFormatError(f"{path}: {difference}; {remedy.format('copy')}")


def _journal_frames(file: h5py.File) -> tuple[list[Frame], list[Frame]]:
    """Return the frames at the begin of the journal, up to the last of the texts, and those at its end."""
    journal = file.get("journal")
    if not isinstance(journal, h5py.Dataset) or journal.ndim != 1 or journal.dtype != np.uint8:
        return [], []
    first = _frames(journal, 0, JOURNAL_CHUNK)
    parts = first[0].rows if first else 0
    end = int(journal.shape[0])
    return first + _frames(journal, JOURNAL_CHUNK, parts * JOURNAL_CHUNK), _frames(
        journal, max(end - 1, 0) // JOURNAL_CHUNK * JOURNAL_CHUNK, end
    )


def _frames(journal: h5py.Dataset, start: int, stop: int) -> list[Frame]:
    return [frame for *_, frame in frames_in(journal[start:stop].tobytes())] if start < stop else []


def first_difference(file: h5py.File, stated: Attributes) -> str:
    """Return the first text of the file that differs from its copy, with both values; an empty text if none does."""
    places = {"/"} | {f"/{parent}/{name}" for parent in ("signals", "events") for name in file.get(parent, ())}
    for place in sorted(places ^ set(stated)):
        holder, other = ("file", "copy of its texts") if place in places else ("copy of the file's texts", "file")
        return f"{place} is in the {holder}, but not in the {other}"
    for place, attributes in stated.items():
        held = file[place].attrs
        for name, value in attributes.items():
            where = name if place == "/" else f"{name} of {place}"
            if name not in held:
                return f"{where} is missing, and {_excerpt(_plain(value), 0)} in the copy of the texts"
            actual = text_attribute(held, name) if isinstance(value, str) else held[name]
            expected = _plain(value)
            if actual != expected:
                at = _first_unequal(str(actual), str(expected))
                shown = _excerpt(actual, at), _excerpt(expected, at)
                return f"{where} is {shown[0]} in the file, but {shown[1]} in the copy of its texts"
    return ""


def _missing_texts(file: h5py.File, tables: Attributes) -> str:
    """Return which series of events has lost its table of texts, or has one that its copy does not name."""
    for place, table in tables.items():
        if place.startswith("/events/") and ("text" in file[place]) != table["texts"]:
            return f"{place} {'lacks a' if table['texts'] else 'has a'} table 'text' unlike in the copy of the texts"
    return ""


def _plain(value: Any) -> Any:
    """Return a value as it is read from an attribute: bytes that are no text are replaced."""
    return value.encode("utf-8", "surrogateescape").decode("utf-8", "replace") if isinstance(value, str) else value


def _first_unequal(left: str, right: str) -> int:
    return next((k for k, pair in enumerate(zip(left, right, strict=False)) if pair[0] != pair[1]), 0)


def _excerpt(value: Any, at: int) -> str:
    """Return a value on one line, of a long text the part around character ``at``."""
    if not isinstance(value, str):
        return str(value)
    if len(value) <= _SHOWN:
        return repr(value)
    start = max(0, at - _SHOWN // 2)
    part = value[start : start + _SHOWN]
    return f"{'...' if start else ''}{part!r}{'...' if start + _SHOWN < len(value) else ''}"
