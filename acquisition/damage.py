"""Opening recordings that were cut short, damaged, or left behind by a writer that was killed."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from foundation import FileFormatError, InputError


def require_stored(samples: h5py.Dataset, name: str, path: Path) -> None:
    """Refuse a damaged size: a table that announces more than the file stores would read as endless zeros."""
    announced = samples.shape[0] * samples.shape[1]
    if samples.chunks is None:
        stored = samples.id.get_storage_size() // samples.dtype.itemsize
    else:
        stored = samples.id.get_num_chunks() * samples.chunks[0] * samples.chunks[1]
    if announced > stored:
        raise FileFormatError(
            f"{path}: /signals/{name} announces {samples.shape[0]} samples but stores at most "
            f"{stored // max(samples.shape[1], 1)}; the file is damaged"
        )
    if samples.chunks is not None and samples.shape[0]:
        last = samples.id.get_chunk_info_by_coord(((samples.shape[0] - 1) // samples.chunks[0] * samples.chunks[0], 0))
        if last.byte_offset is not None and last.byte_offset + last.size > path.stat().st_size:
            raise FileFormatError(f"{path} ends before its samples do; save what is there with millfrf recover")


def whole_rows(samples: h5py.Dataset, file_size: int) -> int:
    """Leading rows whose bytes lie within a file of ``file_size`` bytes; all of them in a file that was not cut."""
    n_rows = int(samples.shape[0])
    if samples.chunks is None:
        return n_rows
    for start in range(0, n_rows, samples.chunks[0]):
        stored = samples.id.get_chunk_info_by_coord((start, 0))
        if stored.byte_offset is None or stored.byte_offset + stored.size > file_size:
            return start
    return n_rows


def superblock_end(path: Path) -> int | None:
    """Where the file says that it ends, bytes, if its superblock has version 3; else None."""
    with path.open("rb") as file:
        superblock = file.read(48)
    if len(superblock) < 48 or superblock[:9] != b"\x89HDF\r\n\x1a\n\x03":
        return None
    return int.from_bytes(superblock[28:36], "little")


def open_for_reading(path: Path) -> h5py.File:
    """Open for reading; a file whose writer was killed opens only with ``swmr=True``."""
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        return h5py.File(path, "r")
    except OSError:
        pass
    try:
        if _writer_was_killed(path):
            return h5py.File(path, "r", libver="latest", swmr=True)
    except (OSError, ValueError) as error:
        raise FileFormatError(f"{path} is damaged beyond what a killed writer leaves; take a copy of it") from error
    raise FileFormatError(f"{path} is not an HDF5 file, or it was cut short or damaged; give a whole recording")


def _writer_was_killed(path: Path) -> bool:
    """Whether the superblock (version 3) says that a single-writer, multiple-reader session was never closed.

    Other files must not be opened so: the library would wait, practically forever, for damaged parts to be written.
    """
    end, still_written = superblock_end(path), 0b101
    with path.open("rb") as file:
        flags = file.read(12)[11:]
    return end is not None and flags == bytes([still_written]) and path.stat().st_size >= end


@contextmanager
def reporting_damage(path: Path) -> Iterator[None]:
    """What the HDF5 library raises on damaged bytes, as one line."""
    try:
        yield
    except (KeyError, OSError, RuntimeError, ValueError, TypeError, AttributeError) as error:
        raise FileFormatError(f"{path} is damaged: {' '.join(str(error).split())}; take a copy of it") from error
