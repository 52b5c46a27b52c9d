"""Names, checks and checksums of the recording file format, shared by its reader and its writer."""

import contextlib
import json
import zlib
from collections.abc import Sequence
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from millfrf.core import FileFormatError, Index, InputError, conversion_advice

from ..channels import Channel
from ..sources.source import StreamDescription

FORMAT = "millfrf.recording"
FORMAT_VERSION = 3
READ_VERSIONS = (1, 2, 3)  # 1 has no checksums, 2 no journal and no checksums of texts
ENDING_BYTES = 240  # size of the line that says how the recording ended: it cannot grow while a file is written
BLOCK_ROWS = 4096  # rows of a block: one damaged byte costs a block, and a reader of one row must read a block
BLOCK_CHUNKS = 1024  # chunks that a block fills at most: the journal lists their addresses

# an entry of a stream's table of blocks, 28 bytes
ENTRY = np.dtype(
    [("number", "<u8"), ("first_row", "<u8"), ("rows", "<u4"), ("samples_sum", "<u4"), ("entry_sum", "<u4")]
)
# rows of a stream that are missing; their samples are NaN
MISSING = np.dtype([("first_row", "<u8"), ("rows", "<u8"), ("reason", "S120"), ("sum", "<u4")])
MISSING_COLUMNS = ("first_row", "rows", "reason")  # in the order of their checksum

Entries = NDArray[np.void]


def text_attribute(attributes: Any, name: str, default: str = "") -> str:
    """Read an attribute as text, whether it is stored as bytes or as a string."""
    value = attributes.get(name, default)
    raw = value if isinstance(value, bytes) else str(value).encode("utf-8", "surrogateescape")
    return raw.decode("utf-8", "replace")


def check_format(attributes: Any, path: object) -> None:
    """Refuse a file that is not a recording, or whose version this program does not know."""
    name = text_attribute(attributes, "format")
    if name != FORMAT:
        raise FileFormatError(
            f"{path} is not a recording: its format is {name or 'not given'!r}, expected {FORMAT!r}; "
            f"{conversion_advice(str(path)) or 'convert it first'}"
        )
    version = attributes.get("format_version")
    if not isinstance(version, (int, np.integer)) or int(version) not in READ_VERSIONS:
        raise FileFormatError(
            f"{path} has format_version {version}, this program reads {', '.join(map(str, READ_VERSIONS))}; "
            "use the program that wrote it"
        )


def stream_from_attributes(name: str, attributes: Any, n_columns: int, path: object) -> StreamDescription:
    """Read rate, start time and channels of ``/signals/<name>`` from its attributes."""
    for required in ("sample_rate", "channels"):
        if required not in attributes:
            raise FileFormatError(f"{path}: /signals/{name} lacks the attribute {required}; record or convert it again")
    try:
        entries = json.loads(text_attribute(attributes, "channels"))
    except json.JSONDecodeError as error:
        raise FileFormatError(
            f"{path}: channels of /signals/{name} are not JSON ({error}); convert it again"
        ) from error
    if not isinstance(entries, list) or len(entries) != n_columns:
        count = len(entries) if isinstance(entries, list) else "no list of"
        raise FileFormatError(f"{path}: /signals/{name} has {n_columns} columns but {count} channels; convert it again")
    try:
        channels = tuple(Channel.from_json(entry) for entry in entries)
        rate, start = float(attributes["sample_rate"]), float(attributes.get("start_time", 0.0))
        return StreamDescription(name, rate, start, channels)
    except (InputError, TypeError, ValueError, OverflowError) as error:
        raise FileFormatError(f"{path}: /signals/{name}: {error}") from error


def block_entries(samples: NDArray[np.floating], first_row: int, number: int, chunk_rows: int) -> Entries:
    """Make the table entries of the blocks into which rows (n_rows, n_channels) are divided.

    ``first_row`` is the number of the first row in its stream, ``number`` the number of the first block, ``chunk_rows``
    the number of rows in a chunk of samples.
    """
    block_rows = min(BLOCK_ROWS, BLOCK_CHUNKS * chunk_rows)
    starts = range(0, len(samples), block_rows)
    entries = np.zeros(len(starts), ENTRY)
    for k, start in enumerate(starts):
        block = samples[start : start + block_rows]
        entries[k] = (number + k, first_row + start, len(block), samples_sum(block, first_row + start), 0)
    entries["entry_sum"] = _entry_sums(entries)
    return entries


def samples_sum(samples: NDArray[np.floating], first_row: int) -> int:
    """Return the checksum of a block's bytes and first row, so that a block at a wrong place does not match."""
    stored = np.ascontiguousarray(samples, samples.dtype.newbyteorder("<"))
    return zlib.crc32(stored.data.cast("B") if stored.size else b"", zlib.crc32(first_row.to_bytes(8, "little")))


def _entry_sums(entries: Entries) -> NDArray[np.uint32]:
    """Return the checksums of the entries without their last field, (n_blocks,)."""
    width = ENTRY.itemsize
    raw = np.ascontiguousarray(entries).tobytes()
    return np.array([zlib.crc32(raw[k : k + width - 4]) for k in range(0, len(raw), width)], np.uint32)


def row_sums(columns: Sequence[NDArray[np.generic]], first: int = 0) -> NDArray[np.uint32]:
    """Return the checksums of the rows of several columns of equal length, each with its row number, (n_rows,).

    All rows are mixed at once, word by word: ``h <- (h xor word) m``, ``h <- h xor (h >> 15)``, as in the hash
    Murmur 3 (A. Appleby, 2011). A change of a single word always changes the sum.

    Examples
    --------
    >>> row_sums([np.array([1.0, 1.0])])
    array([4106477659, 3070601234], dtype=uint32)
    """
    count = len(columns[0])
    if not count:
        return np.empty(0, np.uint32)
    numbers = np.arange(first, first + count, dtype="<u8")
    sums = np.full(count, 0x9747B28C, np.uint32)
    for column in (numbers, *columns):
        for word in _words(column, count).T:
            sums = (sums ^ word) * np.uint32(0x85EBCA6B)
            sums ^= sums >> np.uint32(15)
    return sums


def missing_sums(entries: Entries, first: int = 0) -> NDArray[np.uint32]:
    """Return the checksums of entries of a table of missing rows, (n_entries,)."""
    return row_sums([entries[name] for name in MISSING_COLUMNS], first)


def _words(column: NDArray[np.generic], count: int) -> NDArray[np.uint32]:
    """Return the bytes of each row as 32-bit words, padded with zeros, (n_rows, n_words)."""
    raw = np.ascontiguousarray(column).reshape(count, -1).view(np.uint8)
    padded = np.pad(raw, ((0, 0), (0, -raw.shape[1] % 4)))
    return np.ascontiguousarray(padded).view("<u4")


def read_table(table: h5py.Dataset, *, skip_unreadable: bool = False) -> NDArray[Any]:
    """Read all rows of a table of entries, clock pairs or events.

    With ``skip_unreadable``, rows of chunks that cannot be read are zeros, which match no checksum: after a power
    failure, the index of one table may be torn, or the file may end before a chunk.
    """
    if not skip_unreadable or table.chunks is None:
        return np.asarray(table[:])
    size = table.dtype.itemsize * int(np.prod(table.shape[1:], dtype=int))
    count = min(table.shape[0], table.file.id.get_filesize() // size)  # a damaged length may be anything
    rows = np.zeros((count, *table.shape[1:]), table.dtype)
    for start in range(0, count, table.chunks[0]):
        with contextlib.suppress(OSError, RuntimeError):
            rows[start : start + table.chunks[0]] = table[start : min(start + table.chunks[0], count)]
    return rows


class BlockTable:
    """Table of the blocks of a stream; an entry is valid if it matches its own checksum and its place.

    Attributes
    ----------
    entries : (n_blocks,)
        Entries as they were read.
    valid : (n_blocks,)
        Whether each entry is valid.
    n_rows
        Rows up to the end of the last valid block. Later rows were never acknowledged, or their entry is lost.
    uncovered
        Rows before and between valid blocks for which there is no valid entry, each as (first, end).
    """

    def __init__(self, entries: Entries) -> None:
        self.entries = entries
        self.valid: NDArray[np.bool_] = entries["entry_sum"] == _entry_sums(entries)
        self.valid &= entries["number"] == np.arange(len(entries), dtype=np.uint64)
        self._numbers: Index = np.flatnonzero(self.valid)
        self._first_rows: Index = entries["first_row"][self._numbers].astype(np.int64)
        self._ends: Index = self._first_rows + entries["rows"][self._numbers]
        self.n_rows = int(self._ends[-1]) if len(self._ends) else 0
        previous_ends = np.concatenate([[0], self._ends])[:-1]
        gaps = self._first_rows > previous_ends
        self.uncovered = _spans(previous_ends[gaps], self._first_rows[gaps])

    @staticmethod
    def read(blocks: object, name: str, path: object, *, skip_unreadable: bool = False) -> "BlockTable":
        """Read the table from the dataset ``/signals/<name>/blocks``; refuse a dataset that is no such table."""
        if not isinstance(blocks, h5py.Dataset) or blocks.ndim != 1 or blocks.dtype != ENTRY:
            raise FileFormatError(f"{path}: /signals/{name} has no table 'blocks' of checksums; convert it again")
        return BlockTable(read_table(blocks, skip_unreadable=skip_unreadable))

    @property
    def spans(self) -> list[tuple[int, int]]:
        """Return the rows of the valid blocks, each as (first, end)."""
        return _spans(self._first_rows, self._ends)

    @property
    def damaged_at_end(self) -> int:
        """Return the number of entries after the last valid entry."""
        return len(self.entries) - (int(self._numbers[-1]) + 1 if len(self._numbers) else 0)

    def covering(self, start: int, stop: int) -> range:
        """Return the numbers of the blocks, from the first valid to the last, that hold rows ``start`` to ``stop``."""
        first, end = np.searchsorted(self._ends, start, side="right"), np.searchsorted(self._first_rows, stop)
        numbers = self._numbers[first:end]
        return range(int(numbers[0]), int(numbers[-1]) + 1) if len(numbers) else range(0)


def _spans(starts: Index, ends: Index) -> list[tuple[int, int]]:
    return [(int(start), int(end)) for start, end in zip(starts, ends, strict=True)]
