"""Journal and samples of a recording, found in the raw bytes of its file without HDF5."""

import json
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import NDArray

from .journal import BLOCK, END, JOURNAL_CHUNK, ROWS, TEXTS, Frame, chunks_of, frames_in, texts_of

_WINDOW = 1 << 23  # bytes that are searched at once; a frame that begins in them ends at most a chunk later
_PAGE = 4096  # bytes that a disk reads as a whole or not at all


@dataclass
class Carved:
    """Frames of one journal that were found in raw bytes, by kind and number of their table."""

    texts: dict[str, Any] | None = None
    end: dict[str, Any] = field(default_factory=lambda: {"complete": False, "ending": ""})
    blocks: dict[int, list[Frame]] = field(default_factory=lambda: defaultdict(list))
    rows: dict[int, list[Frame]] = field(default_factory=lambda: defaultdict(list))


def carve(file: BinaryIO, size: int) -> Carved | None:
    """Collect the frames of the journal with the most frames in a file of ``size`` bytes; None if there is no frame."""
    journals: dict[bytes, list[Frame]] = defaultdict(list)
    for start in range(0, size, _WINDOW):
        for place, salt, frame in frames_in(_readable(file, start, min(_WINDOW + JOURNAL_CHUNK, size - start))):
            if place < _WINDOW:
                journals[salt].append(frame)
    if not journals:
        return None
    frames = max(journals.values(), key=len)
    carved = Carved(texts_of(frame for frame in frames if frame.kind == TEXTS))
    for frame in frames:
        if frame.kind == BLOCK:
            carved.blocks[frame.table].append(frame)
        elif frame.kind == ROWS:
            carved.rows[frame.table].append(frame)
        elif frame.kind == END:
            carved.end = json.loads(frame.payload)
    return carved


def _readable(file: BinaryIO, start: int, size: int) -> bytes:
    """Read bytes of a file, with zeros for the pages that its disk cannot read."""
    try:
        file.seek(start)
        return file.read(size)
    except OSError:
        if size <= _PAGE:
            return bytes(size)
    half = -(-size // 2 // _PAGE) * _PAGE
    return _readable(file, start, half) + _readable(file, start + half, size - half)


class RawSamples:
    """Samples (n_samples, n_channels) read from the raw bytes of a file.

    Parameters
    ----------
    file
        The file, opened for reading.
    addresses
        Places of the chunks in the file by number.
    shape, dtype, chunk_rows
        Shape and type of all samples, and rows in a chunk.
    dataset
        HDF5's table, which is read where a chunk has no address; None if it cannot be opened.
    """

    def __init__(
        self,
        file: BinaryIO,
        addresses: Mapping[int, int],
        shape: tuple[int, int],
        dtype: np.dtype[np.floating],
        chunk_rows: int,
        dataset: h5py.Dataset | None,
    ) -> None:
        self.shape, self.dtype, self.chunks = shape, dtype, (chunk_rows, shape[1])
        self._file, self._addresses, self._dataset = file, addresses, dataset

    def __getitem__(self, rows: slice) -> NDArray[np.floating]:
        start, stop, _ = rows.indices(self.shape[0])
        numbers = chunks_of(start, stop, self.chunks[0])
        parts = [self._part(number, start, stop) for number in numbers]
        return np.concatenate(parts) if parts else np.empty((0, self.shape[1]), self.dtype)

    def _part(self, number: int, start: int, stop: int) -> NDArray[np.floating]:
        """Return the rows of one chunk from ``start`` to before ``stop``."""
        first, end = max(start, number * self.chunks[0]), min(stop, (number + 1) * self.chunks[0])
        address, width = self._addresses.get(number), self.shape[1]
        if address is None:
            if self._dataset is None:
                raise OSError(f"chunk {number} is at an unknown place")
            return np.asarray(self._dataset[first:end])
        place = address + (first - number * self.chunks[0]) * width * self.dtype.itemsize
        size = (end - first) * width * self.dtype.itemsize
        self._file.seek(place)
        if len(stored := self._file.read(size)) < size:
            raise OSError(f"chunk {number} lies beyond the end of the file")
        return np.frombuffer(stored, self.dtype).reshape(-1, width)
