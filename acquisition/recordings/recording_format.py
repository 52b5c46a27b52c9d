"""Names, checks and checksums of the recording file format, shared by its reader and its writer."""

import json
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, InputError, conversion_advice

from ..channels import Channel
from ..sources.source import StreamDescription

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


ENTRY = np.dtype(
    [("number", "<u8"), ("first_row", "<u8"), ("rows", "<u4"), ("samples_sum", "<u4"), ("entry_sum", "<u4")]
)
"""An entry of a stream's table of blocks, 28 bytes."""

ROWS_A_BLOCK = 4096
"""Most rows of one block: what a damaged byte costs, and what a reader of one row must read."""

Entries = NDArray[np.void]


def entries_of(samples: NDArray[np.floating], first_row: int, number: int) -> Entries:
    """Entries of the blocks into which rows are divided.

    Parameters
    ----------
    samples : (n_rows, n_channels)
        Rows as they are stored.
    first_row
        Number of the first row in its stream.
    number
        Number of the first block in the stream's table.
    """
    starts = range(0, len(samples), ROWS_A_BLOCK)
    found = np.zeros(len(starts), ENTRY)
    for k, start in enumerate(starts):
        part = samples[start : start + ROWS_A_BLOCK]
        found[k] = (number + k, first_row + start, len(part), samples_sum(part, first_row + start), 0)
    found["entry_sum"] = entry_sums(found)
    return found


def samples_sum(samples: NDArray[np.floating], first_row: int) -> int:
    """Checksum of the stored bytes of a block's rows, and of where they begin."""
    stored = np.ascontiguousarray(samples, samples.dtype.newbyteorder("<"))
    return zlib.crc32(stored.data.cast("B") if stored.size else b"", zlib.crc32(first_row.to_bytes(8, "little")))


def entry_sums(entries: Entries) -> NDArray[np.uint32]:
    """Checksums of the entries themselves, (n_blocks,)."""
    width = ENTRY.itemsize
    raw = np.ascontiguousarray(entries).tobytes()
    return np.array([zlib.crc32(raw[k : k + width - 4]) for k in range(0, len(raw), width)], np.uint32)


def row_sums(columns: Sequence[NDArray[np.generic]], first: int = 0) -> NDArray[np.uint32]:
    """Checksums of rows of several columns, each with its number, (n_rows,).

    All rows at once: word by word ``h <- (h xor word) m``, ``h <- h xor (h >> 15)``, the mixing of the hash Murmur 3
    (A. Appleby, 2011). A change of a single word always changes the sum.

    Parameters
    ----------
    columns
        Arrays of equal length, as they are stored.
    first
        Number of the first row.

    Examples
    --------
    >>> row_sums([np.array([1.0, 1.0])])
    array([4106477659, 3070601234], dtype=uint32)
    """
    count = len(columns[0]) if columns else 0
    if not count:
        return np.empty(0, np.uint32)
    numbers = np.arange(first, first + count, dtype="<u8")
    found = np.full(count, 0x9747B28C, np.uint32)
    for column in (numbers, *columns):
        for word in _words(column, count).T:
            found = (found ^ word) * np.uint32(0x85EBCA6B)
            found ^= found >> np.uint32(15)
    return found


def _words(column: NDArray[np.generic], count: int) -> NDArray[np.uint32]:
    """Bytes of each row as words of 32 bits, zeros behind the last, (n_rows, n_words)."""
    raw = np.ascontiguousarray(column).reshape(count, -1).view(np.uint8)
    padded = np.pad(raw, ((0, 0), (0, -raw.shape[1] % 4)))
    return np.ascontiguousarray(padded).view("<u4")


@dataclass(frozen=True)
class BlockTable:
    """Blocks of a stream as its file announces them.

    Parameters
    ----------
    entries : (n_blocks,)
        Entries as they were read.
    sound : (n_blocks,)
        Entries that match their own checksum and stand at their number.
    """

    entries: Entries
    sound: NDArray[np.bool_]

    @staticmethod
    def read(entries: Entries) -> "BlockTable":
        """The table of entries as they were read; each is judged."""
        whole = entries["entry_sum"] == entry_sums(entries)
        whole &= entries["number"] == np.arange(len(entries), dtype=np.uint64)
        return BlockTable(entries, whole)

    @property
    def n_rows(self) -> int:
        """Rows up to the end of the last sound entry; what stands behind it was never acknowledged, or is lost."""
        ends = self._spans[2]
        return int(ends[-1]) if len(ends) else 0

    @cached_property
    def _spans(self) -> tuple[NDArray[np.intp], NDArray[np.int64], NDArray[np.int64]]:
        """Numbers, first rows and ends of the sound blocks."""
        places = np.flatnonzero(self.sound)
        first_rows = self.entries["first_row"][places].astype(np.int64)
        return places, first_rows, first_rows + self.entries["rows"][places]

    @property
    def damaged_at_end(self) -> int:
        """Entries behind the last sound one."""
        places = self._spans[0]
        return len(self.entries) - (int(places[-1]) + 1 if len(places) else 0)

    def covering(self, start: int, stop: int) -> range:
        """Numbers of the blocks, from the first sound one to the last, in which rows ``start`` to ``stop`` lie."""
        places, first_rows, ends = self._spans
        inside = places[np.searchsorted(ends, start, side="right") : np.searchsorted(first_rows, stop)]
        return range(int(inside[0]), int(inside[-1]) + 1) if len(inside) else range(0)

    @cached_property
    def uncovered(self) -> tuple[tuple[int, int], ...]:
        """Rows before and between sound blocks that no sound entry tells of, each as (first, end)."""
        _, first_rows, ends = self._spans
        before = np.concatenate([[0], ends[:-1]]) if len(ends) else ends
        return tuple((int(a), int(b)) for a, b in zip(before, first_rows, strict=True) if b > a)

    @property
    def spans(self) -> list[tuple[int, int]]:
        """Rows of the sound blocks, each as (first, end)."""
        _, first_rows, ends = self._spans
        return [(int(a), int(b)) for a, b in zip(first_rows, ends, strict=True)]
