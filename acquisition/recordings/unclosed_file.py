"""Files that their writer never closed, presented to the HDF5 library as closed files.

HDF5 marks a file as being written in its superblock (version 3) and clears the mark on closing. The library opens a
marked file only as the reader of a running writer, and then repeats each read of a damaged part practically for ever.
Here the library is shown a superblock without the mark and with the true end of file; the file is not changed.
(HDF5 File Format Specification Version 3.0, section II.A.)
"""

import io
from pathlib import Path
from typing import Any

SUPERBLOCK_BYTES = 48
_SIGNATURE = b"\x89HDF\r\n\x1a\n\x03"
_FLAGS, _END, _CHECKSUM = 11, slice(28, 36), slice(44, 48)  # places in the superblock
_WORD = 0xFFFFFFFF


def superblock(path: Path) -> bytes | None:
    """Read the superblock of version 3 with 8-byte addresses; return None if the file has another kind."""
    with path.open("rb") as file:
        head = file.read(SUPERBLOCK_BYTES)
    fits = len(head) == SUPERBLOCK_BYTES and head.startswith(_SIGNATURE) and head[9:11] == b"\x08\x08"
    return head if fits else None


def is_marked_as_written(path: Path) -> bool:
    """Return whether the superblock says that a writer has not closed the file."""
    block = superblock(path)
    return block is not None and block[_FLAGS] != 0


class UnclosedFile(io.RawIOBase):
    """A binary file for reading, shown with a superblock that says it is closed and has its true length."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        original = superblock(path)
        if original is None:
            raise ValueError(f"{path} has no superblock of version 3")
        block = bytearray(original)
        block[_FLAGS] = 0
        block[_END] = path.stat().st_size.to_bytes(8, "little")
        block[_CHECKSUM] = lookup3(bytes(block[:44])).to_bytes(4, "little")
        self._superblock = bytes(block)
        self._file = path.open("rb", buffering=0)

    def __repr__(self) -> str:
        return str(self._path)  # h5py takes it for the name of the file

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        try:
            return self._file.seek(offset, whence)
        except OverflowError as error:  # a damaged address; the library handles an OSError
            raise OSError(f"address {offset} is beyond any file") from error

    def tell(self) -> int:
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        start = self._file.tell()
        count = self._file.readinto(buffer) or 0
        for k in range(start, min(start + count, SUPERBLOCK_BYTES)):
            memoryview(buffer).cast("B")[k - start] = self._superblock[k]
        return count

    def close(self) -> None:
        if not self.closed and hasattr(self, "_file"):
            self._file.close()
        super().close()


def lookup3(data: bytes) -> int:
    """Compute the hash ``hashlittle`` of Bob Jenkins (2006) without initial value, as HDF5 uses it for its metadata.

    Examples
    --------
    >>> hex(lookup3(b"Four score and seven years ago"))
    '0x17770551'
    """
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    while len(data) > 12:
        a, b, c = _mix(*_added(a, b, c, data[:12]))
        data = data[12:]
    return _final(*_added(a, b, c, data.ljust(12, b"\0"))) if data else c


def _added(a: int, b: int, c: int, data: bytes) -> tuple[int, int, int]:
    x, y, z = (int.from_bytes(data[k : k + 4], "little") for k in (0, 4, 8))
    return (a + x) & _WORD, (b + y) & _WORD, (c + z) & _WORD


def _rotate(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & _WORD


def _mix(a: int, b: int, c: int) -> tuple[int, int, int]:
    for bits in (4, 6, 8, 16, 19, 4):
        a = ((a - c) & _WORD) ^ _rotate(c, bits)
        c = (c + b) & _WORD
        a, b, c = b, c, a
    return a, b, c


def _final(a: int, b: int, c: int) -> int:
    for bits in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _rotate(b, bits)) & _WORD
        a, b, c = b, c, a
    return b
