"""HDF5's global heap, where texts of any length lie without a checksum, looked through before the library trusts it.

A collection is ``GCOL``, a version, its size, and objects one after the other: index, references, size, data rounded up
to 8 bytes; the object of index 0 is the free rest. A wrong size sends the library round in a circle.
(HDF5 File Format Specification Version 3.0, section III.E.)
"""

import struct
from pathlib import Path

_SCANNED = 1 << 20
_HEAD = 16


def heaps_are_sound(path: Path) -> bool:
    """Whether the first MB of a file, where recordings have their texts, holds such heaps and all of them are whole."""
    with path.open("rb") as file:
        data = file.read(_SCANNED)
    at, found = data.find(b"GCOL"), False
    while at >= 0:
        if not _is_sound(data, at):
            return False
        found = True
        at = data.find(b"GCOL", at + struct.unpack_from("<Q", data, at + 8)[0])
    return found


def _is_sound(data: bytes, start: int) -> bool:
    if start + _HEAD > len(data) or data[start + 4] != 1:
        return False
    end = start + int(struct.unpack_from("<Q", data, start + 8)[0])
    at = start + _HEAD
    if not at <= end <= len(data):
        return False
    seen: set[int] = set()
    while end - at >= _HEAD:
        index, size = struct.unpack_from("<H6xQ", data, at)
        if index == 0:
            return bool(size == end - at)
        if index in seen:
            return False
        seen.add(index)
        at += _HEAD + size + -size % 8
    return at <= end
