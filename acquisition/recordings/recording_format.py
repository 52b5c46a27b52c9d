"""Names and checks of the recording file format, shared by its reader and its writer."""

import json
from typing import Any

import numpy as np

from foundation import FileFormatError, InputError, conversion_advice

from ..channel import Channel
from ..sources import StreamDescription

FORMAT = "millfrf.recording"
FORMAT_VERSION = 2
READ_VERSIONS = (1, 2)
"""Versions that are read; the first has no checksums."""
ENDING_BYTES = 240
"""Room for the line that says how the recording ended; attributes cannot grow while a file is written."""


def text_attribute(attributes: Any, name: str, default: str = "") -> str:
    """A root attribute as text, whether stored as bytes or string."""
    value = attributes.get(name, default)
    raw = value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogateescape")
    return raw.decode("utf-8", "replace")


def check_format(attributes: Any, path: object) -> None:
    """Refuse a file that is no recording, or one of a version this program does not know.

    Raises
    ------
    FileFormatError
        With the value found.
    """
    found = text_attribute(attributes, "format")
    if found != FORMAT:
        raise FileFormatError(
            f"{path} is not a recording: its format is {found or 'not given'!r}, expected {FORMAT!r}; "
            f"{conversion_advice(str(path)) or 'convert it first'}"
        )
    version = attributes.get("format_version")
    if not isinstance(version, (int, np.integer)) or int(version) not in READ_VERSIONS:
        raise FileFormatError(
            f"{path} has format_version {version}, this program reads {' and '.join(map(str, READ_VERSIONS))}; "
            "use the program that wrote it"
        )


def stream_from_attributes(name: str, attributes: Any, n_columns: int, path: object) -> StreamDescription:
    """Read rate, start time and channels of ``/signals/<name>``.

    Raises
    ------
    FileFormatError
        An attribute is missing or malformed, or the channels do not match the columns.
    """
    for needed in ("sample_rate", "channels"):
        if needed not in attributes:
            raise FileFormatError(f"{path}: /signals/{name} lacks the attribute {needed}; record or convert anew")
    try:
        listed = json.loads(text_attribute(attributes, "channels"))
    except json.JSONDecodeError as error:
        raise FileFormatError(f"{path}: channels of /signals/{name} are not JSON ({error}); convert anew") from error
    if not isinstance(listed, list) or len(listed) != n_columns:
        count = len(listed) if isinstance(listed, list) else "no list of"
        raise FileFormatError(f"{path}: /signals/{name} has {n_columns} columns but {count} channels; convert anew")
    try:
        channels = tuple(Channel.from_json(entry) for entry in listed)
        rate, start = float(attributes["sample_rate"]), float(attributes.get("start_time", 0.0))
        return StreamDescription(name, rate, start, channels)
    except (InputError, TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(f"{path}: /signals/{name}: {error}") from error
