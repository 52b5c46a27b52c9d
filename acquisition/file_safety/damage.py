"""Opening recordings that were cut short, damaged, or left behind by a writer that was killed."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import h5py

from foundation import FileFormatError, InputError, conversion_advice

from .durability import is_being_written
from .guarded_reading import rehearse
from .text_heap import heaps_are_sound
from .unclosed_file import UnclosedFile, is_marked_as_written, superblock


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
        try:
            stored = samples.id.get_chunk_info_by_coord((start, 0))
        except RuntimeError:  # what tells where the chunk lies was not written any more
            return start
        if stored.byte_offset is None or stored.byte_offset + stored.size > file_size:
            return start
    return n_rows


def open_for_reading(path: Path, *, accept_cut: bool = False) -> h5py.File:
    """Open a recording for reading, also beside a living writer, or after its writer was killed.

    Parameters
    ----------
    path
        Path of the file.
    accept_cut
        Whether to open a file that ends before it says; parts of it must then not be read.

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        It cannot be opened.
    """
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    if superblock(path) is None and h5py.is_hdf5(path):  # an older form, whose parts have no checksums
        rehearse(path)
    try:
        return _without_loose_texts(h5py.File(path, "r"), path)
    except OSError:
        pass
    try:
        if is_marked_as_written(path) and is_being_written(path):
            return h5py.File(path, "r", libver="latest", swmr=True)
        if is_marked_as_written(path) or (accept_cut and superblock(path) is not None):
            return _without_loose_texts(h5py.File(UnclosedFile(path), "r"), path)
    except (OSError, ValueError, RuntimeError) as error:
        raise FileFormatError(f"{path} is damaged beyond what a killed writer leaves; take a copy of it") from error
    if advice := conversion_advice(path):
        raise FileFormatError(f"{path} is a file of another program; {advice}")
    raise FileFormatError(
        f"{path} is not an HDF5 file, or it was cut short or damaged; give a whole recording, or try millfrf recover"
    )


def _without_loose_texts(file: h5py.File, path: Path) -> h5py.File:
    """The open file, once it is known that its texts of any length, which have no checksum, can be read."""
    try:
        with reporting_damage(path):
            parts = (file, *_groups(file.get("signals")), *_groups(file.get("events")))
            loose = any(_has_loose_text(part) for part in parts)
        if loose and not heaps_are_sound(path):
            rehearse(path)
    except BaseException:
        file.close()
        raise
    return file


def _groups(parent: object) -> list[h5py.Group]:
    return (
        [entry for entry in parent.values() if isinstance(entry, h5py.Group)] if isinstance(parent, h5py.Group) else []
    )


def _has_loose_text(part: h5py.Group) -> bool:
    """Whether an attribute is a text of any length; its type is looked at, not its value."""
    kinds = (part.attrs.get_id(name).get_type() for name in part.attrs)
    return any(isinstance(kind, h5py.h5t.TypeStringID) and kind.is_variable_str() for kind in kinds)


@contextmanager
def reporting_damage(path: Path) -> Iterator[None]:
    """Turn the errors that the HDF5 library raises on damaged bytes into one line."""
    try:
        yield
    except (KeyError, OSError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise FileFormatError(f"{path} is damaged: {' '.join(str(error).split())}; take a copy of it") from error
