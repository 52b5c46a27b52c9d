"""Journal of a recording: frames that describe themselves, so that they are found in the raw bytes of a damaged file.

A frame has a header of 48 bytes (little endian): magic, salt of the file, kind, number of the table, first row, rows,
bytes of the payload, and the CRC-32 of all that and of the payload. HDF5 stores the journal in chunks that are not
compressed, and no frame crosses the end of a chunk, so that every frame is contiguous in the file.
"""

import hashlib
import json
import struct
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from .recording_format import ENTRY, Entries

MAGIC = b"\x89mfrFRM\n"
JOURNAL_CHUNK = 1 << 14  # bytes; a chunk is written again with each frame
TEXTS, BLOCK, ROWS, END = range(1, 5)  # kinds of frames
_HEADER = struct.Struct("<8s8sIIQII4xI")
LARGEST_PAYLOAD = JOURNAL_CHUNK - _HEADER.size


@dataclass(frozen=True)
class Frame:
    """A frame of the journal.

    Parameters
    ----------
    kind
        ``TEXTS``: a part of all texts; ``BLOCK``: a block of samples, as its entry in the table of blocks and the
        addresses of the chunks that hold it; ``ROWS``: clock pairs or events, column by column; ``END``: how the
        recording ended.
    table
        Number of the table, :func:`table_number`.
    first, rows
        First row and number of rows; of a text, number of the part and number of parts.
    payload
        Content.
    """

    kind: int
    table: int
    first: int
    rows: int
    payload: bytes

    def packed(self, salt: bytes) -> bytes:
        """Return the bytes of the frame in a file with this salt, a multiple of 8."""
        fields = (MAGIC, salt, self.kind, self.table, self.first, self.rows, len(self.payload))
        total = zlib.crc32(self.payload, zlib.crc32(_HEADER.pack(*fields, 0)))
        return _HEADER.pack(*fields, total) + self.payload + bytes(-len(self.payload) % 8)


def frames_in(data: bytes) -> Iterator[tuple[int, bytes, Frame]]:
    """Yield place, salt and content of all valid frames in raw bytes, in the order of their places."""
    at = data.find(MAGIC)
    while at >= 0:
        step = 1
        if at + _HEADER.size <= len(data):
            _, salt, *numbers, length, total = _HEADER.unpack_from(data, at)
            begin = at + _HEADER.size
            payload = bytes(data[begin : begin + length]) if length <= LARGEST_PAYLOAD else b""
            fields = MAGIC, salt, *numbers, length
            if len(payload) == length and zlib.crc32(payload, zlib.crc32(_HEADER.pack(*fields, 0))) == total:
                kind, table, first, rows = numbers
                yield at, salt, Frame(kind, table, first, rows, payload)
                step = _HEADER.size + length
        at = data.find(MAGIC, at + step)


def has_journal(path: Path) -> bool:
    """Return whether the first MB of a file, where recordings of version 3 begin their journal, holds a frame."""
    with path.open("rb") as file:
        return next(frames_in(file.read(1 << 20)), None) is not None


def table_number(place: str) -> int:
    """Return the number by which frames name a table, such as ``/signals/main``."""
    return zlib.crc32(place.encode("utf-8", "surrogateescape"))


def text_frames(texts: Mapping[str, Any]) -> list[Frame]:
    """Return the frames of all texts: the SHA-256 of their JSON text, and the JSON text."""
    content = json.dumps(texts).encode()
    content = hashlib.sha256(content).digest() + content
    parts = [content[k : k + LARGEST_PAYLOAD] for k in range(0, len(content), LARGEST_PAYLOAD)]
    return [Frame(TEXTS, 0, k, len(parts), part) for k, part in enumerate(parts)]


def texts_of(frames: Iterable[Frame]) -> dict[str, Any] | None:
    """Return the texts that frames hold, or None if a part is missing or the sum is wrong."""
    parts = {frame.first: frame for frame in frames if frame.kind == TEXTS}
    if not parts or set(parts) != set(range(parts[min(parts)].rows)):
        return None
    content = b"".join(parts[k].payload for k in sorted(parts))
    if hashlib.sha256(content[32:]).digest() != content[:32]:
        return None
    texts: dict[str, Any] = json.loads(content[32:])
    return texts


def end_frame(complete: bool, ending: str) -> Frame:
    """Return the frame that says how a recording ended."""
    return Frame(END, 0, 0, 0, json.dumps({"complete": complete, "ending": ending}).encode())


def row_frames(place: str, first: int, columns: Sequence[NDArray[np.generic]]) -> list[Frame]:
    """Return the frames of new rows of a table, in as many parts as their bytes need."""
    width = sum(column[:1].nbytes for column in columns)
    step = max(LARGEST_PAYLOAD // max(width, 1), 1)
    return [
        Frame(
            ROWS,
            table_number(place),
            first + k,
            len(columns[0][k : k + step]),
            b"".join(np.ascontiguousarray(column[k : k + step]).tobytes() for column in columns),
        )
        for k in range(0, len(columns[0]), step)
    ]


def block_frames(place: str, entries: Entries, addresses: Mapping[int, int], chunk_rows: int) -> list[Frame]:
    """Return the frames of new blocks; ``addresses`` gives the places in the file of the chunks by number."""
    frames = []
    for entry in entries:
        first, rows = int(entry["first_row"]), int(entry["rows"])
        places = [addresses[number] for number in chunks_of(first, first + rows, chunk_rows)]
        payload = entry.tobytes() + np.array(places, "<u8").tobytes()
        frames.append(Frame(BLOCK, table_number(place), first, rows, payload))
    return frames


def block_of(frame: Frame) -> tuple[np.void, NDArray[np.uint64]]:
    """Return the entry of a block and the addresses of the chunks that hold it."""
    entry: np.void = np.frombuffer(frame.payload, ENTRY, 1)[0]
    return entry, np.frombuffer(frame.payload, "<u8", offset=ENTRY.itemsize)


def chunks_of(start: int, stop: int, chunk_rows: int) -> range:
    """Return the numbers of the chunks that hold rows ``start`` to before ``stop``."""
    return range(start // chunk_rows, -(-stop // chunk_rows))


class Journal:
    """Journal of a recording that is written."""

    def __init__(self, dataset: h5py.Dataset, salt: bytes) -> None:
        self._dataset = dataset
        self._salt = salt
        self.length = 0  # bytes

    def append(self, frames: Iterable[Frame]) -> None:
        """Append frames and hand them to the operating system."""
        content = bytearray()
        for frame in frames:
            packed = frame.packed(self._salt)
            room = -(self.length + len(content)) % JOURNAL_CHUNK
            content += bytes(room if len(packed) > (room or JOURNAL_CHUNK) else 0) + packed
        end = self.length + len(content)
        self._dataset.resize((end,))
        self._dataset[self.length : end] = np.frombuffer(content, np.uint8)
        self._dataset.flush()
        self.length = end

    def cut(self, length: int) -> None:
        """Take back what was appended after ``length`` bytes."""
        self._dataset.resize((length,))
        self._dataset.flush()
        self.length = length
