"""A look at the tags of a MATLAB file (version 5) before scipy reads it: a wrong one would end Python itself.

Every element is a tag (type, number of bytes) and its data; matrices and compressed elements hold further ones
(MathWorks, MAT-File Format, chapter 1).
"""

import struct
import zlib
from pathlib import Path

from foundation import FileFormatError

_MATRIX, _COMPRESSED = 14, 15
_KNOWN = {*range(1, 8), 9, 12, 13, _MATRIX, 16, 17, 18}
_HEADER, _DEEPEST = 128, 64


def require_whole_tags(path: Path) -> None:
    """Refuse a file of version 5 whose tags are not whole; others are passed.

    Raises
    ------
    FileFormatError
        A tag of unknown type, or one that says more bytes than there are.
    """
    data = memoryview(path.read_bytes())
    mark = bytes(data[126:128])
    if mark not in (b"IM", b"MI"):
        return
    order = "<" if mark == b"IM" else ">"
    try:
        _walk(data[_HEADER:], order, 0)
    except (ValueError, struct.error, zlib.error) as error:
        raise FileFormatError(f"{path} is damaged: {error}; save it anew") from error


def _walk(data: memoryview, order: str, depth: int) -> None:
    """All elements one after the other."""
    if depth > _DEEPEST:
        raise ValueError("arrays are nested too deep")
    at = 0
    while len(data) - at >= 8:
        kind, size = struct.unpack_from(order + "II", data, at)
        if kind >> 16:  # a small element: up to four bytes beside their tag
            kind, size, begin, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise ValueError(f"a small element of {size} bytes")
        else:
            begin = at + 8
            end = begin + size + (0 if kind == _COMPRESSED else -size % 8)
        if kind not in _KNOWN and kind != _COMPRESSED:
            raise ValueError(f"an element of unknown type {kind}")
        if begin + size > len(data):
            raise ValueError(f"an element of {size} bytes where {len(data) - begin} are left")
        if kind == _COMPRESSED:
            _walk(memoryview(zlib.decompress(data[begin : begin + size])), order, depth + 1)
        elif kind == _MATRIX:
            _walk(data[begin : begin + size], order, depth + 1)
        at = end
