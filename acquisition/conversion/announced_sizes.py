"""Headers of NPY and WAV files, whose sizes must be those of the file before anything is allocated."""

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from numpy.lib import format as npy

from millfrf.core import FileFormatError

_UNKNOWN = 0xFFFFFFFF  # size of a file that was never closed, or that is stated elsewhere


def require_npy(stream: IO[bytes], size: int, path: Path, name: str) -> None:
    """Refuse an array in NPY format whose header announces another size than ``size``, the bytes of ``stream``."""
    read_header = npy.read_array_header_1_0 if npy.read_magic(stream) == (1, 0) else npy.read_array_header_2_0
    shape, _, dtype = read_header(stream)
    announced, held = math.prod(shape) * dtype.itemsize, size - stream.tell()
    if announced != held and not dtype.hasobject:  # pickled objects have no size, and are refused elsewhere
        raise FileFormatError(
            f"{path}: array {name} announces {announced} bytes and holds {held}; it is damaged or cut short, save it "
            "again"
        )


def require_wav(path: Path) -> None:
    """Refuse a WAV file with a chunk that is longer than the file, or with bytes that belong to no chunk."""
    remedy = "it is damaged or cut short, record or export it again"
    size = path.stat().st_size
    with path.open("rb") as file:
        if (mark := file.read(12))[:4] not in (b"RIFF", b"RIFX", b"RF64") or mark[8:] != b"WAVE":
            return  # scipy names what it reads
        order = ">" if mark.startswith(b"RIFX") else "<"
        stated = struct.unpack(f"{order}4xI", mark[:8])[0]
        end = min(stated + 8, size) if 0 < stated < _UNKNOWN else size
        for kind, begin, announced in _chunks(file, order, end):
            if not kind.isascii() or not kind.decode().isprintable():
                raise FileFormatError(f"{path} holds bytes after byte {begin - 8} that no header announces; {remedy}")
            if announced > size - begin:
                of = kind.decode().strip()
                raise FileFormatError(f"{path} announces {announced} bytes of {of} and holds {size - begin}; {remedy}")


def _chunks(file: IO[bytes], order: str, end: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield kind, place and announced bytes of each chunk; ``order`` is the byte order for `struct`."""
    begin, size_of_data = file.tell() + 8, 0
    while begin < end + 7:  # the last byte may be one of padding
        if begin > end:
            yield b"\0", begin, 0
            return
        kind, announced = struct.unpack(f"{order}4sI", file.read(8))
        if kind == b"ds64":  # sizes of a file above 4 GB: of the file, of its data
            size_of_data = struct.unpack(f"{order}8xQ", file.read(16).ljust(16, b"\0"))[0]
        elif kind == b"data" and size_of_data:
            announced = size_of_data
        yield kind, begin, announced
        begin += announced + announced % 2 + 8
        file.seek(begin - 8)
