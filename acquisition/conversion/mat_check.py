"""A look at the tags of a MATLAB file (version 5) before scipy reads it: a wrong one would end Python itself.

Every element is a tag (type, number of bytes) and its data; matrices and compressed elements hold further ones
(MathWorks, MAT-File Format, chapter 1).
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from foundation import FileFormatError

_MATRIX, _COMPRESSED = 14, 15
_SIZES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
"""Bytes a number, by the type of an element."""
_TEXTS = (2, 4, 16)
_HEADER, _DEEPEST = 128, 64
_EXPANSION, _SPARE = 16, 64_000_000
_CHAR, _NUMERIC = 4, range(6, 16)
_COMPLEX = 0x800

Element = tuple[int, memoryview]


def is_plain_mat(path: Path) -> bool:
    """Whether a file holds nothing but arrays of numbers and texts whose sizes agree; scipy reads those safely.

    False also for other versions, which have no such tags.

    Raises
    ------
    FileFormatError
        A tag of unknown type, or one that says more bytes than there are.
    """
    data = memoryview(path.read_bytes())
    if len(data) < _HEADER and bytes(data[:6]) == b"MATLAB":
        raise FileFormatError(f"{path} is damaged: it ends within its header; save it anew")
    mark = bytes(data[126:128])
    if mark not in (b"IM", b"MI"):
        return False
    order = "<" if mark == b"IM" else ">"
    try:
        return all(_is_plain(*element, order, len(data)) for element in _elements(data[_HEADER:], order))
    except (ValueError, struct.error, zlib.error) as error:
        raise FileFormatError(f"{path} is damaged: {error}; save it anew") from error


def _elements(data: memoryview, order: str) -> Iterator[Element]:
    """Type and data of all elements one after the other."""
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
        if kind not in _SIZES and kind not in (_MATRIX, _COMPRESSED):
            raise ValueError(f"an element of unknown type {kind}")
        if begin + size > len(data):
            raise ValueError(f"an element of {size} bytes where {len(data) - begin} are left")
        yield kind, data[begin : begin + size]
        at = end


def _is_plain(kind: int, data: memoryview, order: str, file_size: int) -> bool:
    """Say whether one element at the top holds plain data."""
    if kind == _COMPRESSED:
        inflater = zlib.decompressobj()
        whole = inflater.decompress(data, _EXPANSION * file_size + _SPARE)
        if inflater.unconsumed_tail or not inflater.eof:
            raise ValueError("a compressed element that is cut short or grows beyond all measure")
        inner = list(_elements(memoryview(whole), order))
        return len(inner) == 1 and inner[0][0] == _MATRIX and _is_plain_matrix(inner[0][1], order)
    return kind == _MATRIX and _is_plain_matrix(data, order)


def _is_plain_matrix(data: memoryview, order: str, depth: int = 0) -> bool:
    """An array of numbers or a text, as large as its dimensions say; what is nested is at least walked through."""
    if depth > _DEEPEST:
        raise ValueError("arrays are nested too deep")
    parts = list(_elements(data, order))
    for kind, inner in parts:
        if kind == _MATRIX:
            _is_plain_matrix(inner, order, depth + 1)
    if len(parts) < 4 or [kind for kind, _ in parts[:3]] != [6, 5, 1] or len(parts[0][1]) != 8:
        return False
    flags = struct.unpack(order + "II", parts[0][1])[0]
    dimensions = struct.unpack(f"{order}{len(parts[1][1]) // 4}i", parts[1][1][: len(parts[1][1]) // 4 * 4])
    count = 1
    for length in dimensions:
        count *= length
    if not 2 <= len(dimensions) <= 32 or min(dimensions) < 0:
        return False
    values = parts[3:]
    if flags & 0xFF == _CHAR:
        return len(values) == 1 and values[0][0] in _TEXTS and len(values[0][1]) <= 4 * count + 8
    wanted = 2 if flags & _COMPLEX else 1
    return (
        flags & 0xFF in _NUMERIC
        and len(values) == wanted
        and all(kind in _SIZES and len(part) == count * _SIZES[kind] for kind, part in values)
    )
