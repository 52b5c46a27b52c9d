"""Places in a file of the chunks of a table, found while they are written."""

from collections.abc import Callable

import h5py
import numpy as np
from numpy.typing import NDArray

from .journal import chunks_of

_PROBE = 64  # bytes that are compared first


class ChunkPlaces:
    """Addresses in the file of the chunks of a table of samples.

    HDF5 states the address of a chunk after a search through all chunks. A new chunk nearly always lies at the former
    end of the file, which takes no search; an address is used only if the bytes there are those that were written.

    Parameters
    ----------
    samples
        Table whose chunks are not compressed.
    read
        Reads bytes of the file: address and number.
    page
        Multiple of which an address of a large chunk is, bytes.
    """

    def __init__(self, samples: h5py.Dataset, read: Callable[[int, int], bytes], page: int) -> None:
        self._samples, self._file, self._read, self._page = samples, samples.file.id, read, page
        self._row_bytes = samples.dtype.itemsize * samples.shape[1]
        self._chunk_rows = samples.chunks[0]
        self._last: dict[int, int] = {}  # address of the last chunk by number
        self._end = 0

    def note_end(self) -> None:
        """Note where the file ends before rows are written."""
        self._end = int(self._file.get_filesize())

    def of(self, start: int, rows: NDArray[np.floating]) -> dict[int, int]:
        """Return the addresses by number of the chunks that hold new rows, which were written from ``start`` on."""
        if not len(rows):
            return {}
        addresses: dict[int, int] = {}
        at = -(-self._end // self._page) * self._page
        for number in chunks_of(start, start + len(rows), self._chunk_rows):
            first = max(number * self._chunk_rows, start)
            stored = rows[first - start : (number + 1) * self._chunk_rows - start].tobytes()
            offset = (first - number * self._chunk_rows) * self._row_bytes
            address = self._last.get(number)
            if address is None:
                address = self._search(at, stored)
            if address is None or self._read(address + offset, len(stored)) != stored:
                addresses = self._listed(start, start + len(rows))
                break
            addresses[number] = address
            at = address + self._chunk_rows * self._row_bytes
            at += -at % self._page
        self._last = {max(addresses): addresses[max(addresses)]}
        return addresses

    def _search(self, at: int, stored: bytes) -> int | None:
        """Return the first page from ``at`` on that begins with the bytes; None if there is none."""
        size = self._chunk_rows * self._row_bytes
        if size < self._page:  # several chunks in a page
            return None
        end = int(self._file.get_filesize())
        probe = stored[:_PROBE]
        pages = range(at, end - size + 1, self._page)
        return next((page for page in pages if self._read(page, len(probe)) == probe), None)

    def _listed(self, start: int, stop: int) -> dict[int, int]:
        """Return the addresses of chunks as HDF5 lists them."""
        wanted = chunks_of(start, stop, self._chunk_rows)
        addresses: dict[int, int] = {}

        def note(chunk: h5py.h5d.StoreInfo) -> None:
            number = chunk.chunk_offset[0] // self._chunk_rows
            if number in wanted:
                addresses[number] = chunk.byte_offset

        self._samples.id.chunk_iter(note)
        return addresses
