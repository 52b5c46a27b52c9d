"""Files that their writer never closed, seen as if it had: the library reads them without waiting for anybody.

HDF5 marks a file as being written in its superblock (version 3) and clears the mark on closing. A marked file opens
only beside a living writer, and then the library repeats every read of a damaged part for practically ever. Here the
mark is cleared and the end of file corrected in what the library is shown; the file itself is not touched.
(HDF5 File Format Specification Version 3.0, sections II.A and on the checksum of Jenkins, lookup3.)
"""

import io
from pathlib import Path
from typing import Any

SIGNATURE = b"\x89HDF\r\n\x1a\n\x03"
SUPERBLOCK_BYTES = 48
_FLAGS, _END, _CHECKSUM = 11, slice(28, 36), slice(44, 48)
_WORD = 0xFFFFFFFF


def superblock(path: Path) -> bytes | None:
    """The superblock, if it is one of version 3 with 8-byte addresses; else None."""
    with path.open("rb") as file:
        found = file.read(SUPERBLOCK_BYTES)
    whole = len(found) == SUPERBLOCK_BYTES and found.startswith(SIGNATURE) and found[9:11] == b"\x08\x08"
    return found if whole else None


def is_marked_as_written(path: Path) -> bool:
    """Whether the superblock says that a writer has not closed the file."""
    found = superblock(path)
    return found is not None and found[_FLAGS] != 0


class UnclosedFile(io.RawIOBase):
    """A binary file for reading whose superblock says: closed, and as long as it is.

    Parameters
    ----------
    path
        A file with a superblock of version 3.

    Raises
    ------
    ValueError
        It has none.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        found = superblock(path)
        if found is None:
            raise ValueError(f"{path} has no superblock of version 3")
        changed = bytearray(found)
        changed[_FLAGS] = 0
        changed[_END] = path.stat().st_size.to_bytes(8, "little")
        changed[_CHECKSUM] = lookup3(bytes(changed[:44])).to_bytes(4, "little")
        self._start = bytes(changed)
        self._file = path.open("rb", buffering=0)

    def readable(self) -> bool:
        """Say that the file can be read."""
        return True

    def seekable(self) -> bool:
        """Say that the file can be positioned."""
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """As of any file; a damaged address beyond all files is an OSError."""
        try:
            return self._file.seek(offset, whence)
        except OverflowError as error:
            raise OSError(f"address {offset} is beyond any file") from error

    def tell(self) -> int:
        """As of any file."""
        return self._file.tell()

    def readinto(self, buffer: Any) -> int:
        """As of any file, with the superblock changed."""
        at = self._file.tell()
        count = self._file.readinto(buffer) or 0
        for k in range(at, min(at + count, SUPERBLOCK_BYTES)):
            memoryview(buffer).cast("B")[k - at] = self._start[k]
        return count

    def close(self) -> None:
        """Close the file beneath."""
        if not self.closed and hasattr(self, "_file"):
            self._file.close()
        super().close()


def lookup3(data: bytes) -> int:
    """Bob Jenkins' hash of 2006, ``hashlittle`` with no initial value, as HDF5 uses it for metadata.

    Examples
    --------
    >>> hex(lookup3(b"Four score and seven years ago"))
    '0x17770551'
    """
    a = b = c = (0xDEADBEEF + len(data)) & _WORD
    while len(data) > 12:
        words = [int.from_bytes(data[k : k + 4], "little") for k in (0, 4, 8)]
        a, b, c = _mixed((a + words[0]) & _WORD, (b + words[1]) & _WORD, (c + words[2]) & _WORD)
        data = data[12:]
    if not data:
        return c
    tail = data.ljust(12, b"\0")
    words = [int.from_bytes(tail[k : k + 4], "little") for k in (0, 4, 8)]
    return _final((a + words[0]) & _WORD, (b + words[1]) & _WORD, (c + words[2]) & _WORD)


def _turned(word: int, bits: int) -> int:
    return ((word << bits) | (word >> (32 - bits))) & _WORD


def _mixed(a: int, b: int, c: int) -> tuple[int, int, int]:
    for bits in (4, 6, 8, 16, 19, 4):
        a = ((a - c) & _WORD) ^ _turned(c, bits)
        c = (c + b) & _WORD
        a, b, c = b, c, a
    return a, b, c


def _final(a: int, b: int, c: int) -> int:
    for bits in (14, 11, 25, 16, 4, 14, 24):
        c = ((c ^ b) - _turned(b, bits)) & _WORD
        a, b, c = b, c, a
    return b
