"""Reading of damaged files: checks before the library opens them, and readers in a separate process.

One changed bit can crash scipy's reader of MAT files or send the HDF5 library into an endless loop
(docs/decisions/0009-guarded-reading.md).
"""

import faulthandler
import json
import math
import multiprocessing
import os
import struct
import subprocess
import sys
import tempfile
import threading
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np

from millfrf.core import FileFormatError, InputError, command, conversion_advice, end_with
from millfrf.core.file_locks import is_being_written

from ..settings import SETTINGS
from .journal import has_journal
from .reading_child import REFUSED, attempt
from .unclosed_file import UnclosedFile, is_marked_as_written, superblock

_CHILD = Path(__file__).with_name("reading_child.py")
_ENDLESS = "reading it does not come to an end"
_CRASHED = "reading it crashes or does not come to an end"
_checked: set[tuple[str, int, int]] = set()  # path, time of change and size of the files that a child has read


@dataclass(frozen=True)
class UnreadObject:
    """Object of MATLAB, whose content only MATLAB reads; ``kind`` is its class, such as ``table``."""

    kind: str


def read_guarded(path: Path, job: Literal["mat", "arrays"]) -> dict[str, Any]:
    """Read the arrays and texts of a file by name, in a child process.

    A cell of texts becomes an array of texts, an object of MATLAB an `UnreadObject`; contents of other kinds become an
    empty array.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run_child(path, job, folder)
        entries = json.loads((folder / "index.json").read_text(encoding="utf-8"))
        return {entry["name"]: _content(entry, folder) for entry in entries}


def _content(entry: dict[str, Any], folder: Path) -> Any:
    if "object" in entry:
        return UnreadObject(entry["object"])
    if "text" in entry:
        return entry["text"]
    if "texts" in entry:
        return np.array(entry["texts"], dtype=str)
    if "file" in entry:
        return np.load(folder / entry["file"], allow_pickle=False)
    return np.empty(0, dtype=object)


def check_in_child(path: Path) -> None:
    """Open a recording and read its structure and texts in a child process, once for each state of the file."""
    status = path.stat()
    state = (os.fspath(path.resolve()), status.st_mtime_ns, status.st_size)
    if state in _checked:
        return
    if _can_fork():
        _check_in_fork(path)
    else:
        with tempfile.TemporaryDirectory() as folder:
            _run_child(path, "check", Path(folder))
    _checked.add(state)


def _can_fork() -> bool:
    """Return whether a fork of this process can be the child; with threads, a fork could wait for a lock for ever."""
    alone = threading.active_count() == 1 and multiprocessing.parent_process() is None
    return sys.platform == "linux" and alone


def _check_in_fork(path: Path) -> None:
    """Check a file in a fork, which has loaded the libraries already and is 20 times as fast as a new process."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_report_attempt, args=(path, sender, os.getpid()), daemon=True)
    child.start()
    sender.close()
    child.join(_longest_time(path))
    if child.is_alive():
        child.kill()
        child.join()
        raise FileFormatError(f"{path} is damaged: {_ENDLESS}; {_remedy(path)}")
    if child.exitcode != 0:
        raise FileFormatError(f"{path} is damaged: {_CRASHED}; {_remedy(path)}")
    mistake = receiver.recv_bytes().decode("utf-8", "replace")
    receiver.close()
    if mistake:
        raise FileFormatError(f"{path} is damaged: {mistake}; {_remedy(path)}")


def _report_attempt(path: Path, pipe: Connection, parent: int) -> None:
    """Check the file and send the result; main function of the fork.

    Its standard error is closed, because crashing libraries write to it.
    """
    end_with(parent)
    faulthandler.disable()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    pipe.send_bytes(attempt("check", path, path.parent)[:1000].encode())


def _remedy(path: Path) -> str:
    return f"save what is there: {command('recover', path)}" if has_journal(path) else "take a copy of it"


def _longest_time(path: Path) -> float:
    """Return the time within which a file must be read, s."""
    return SETTINGS.reading_time + path.stat().st_size / SETTINGS.reading_bytes_per_second


def _run_child(path: Path, job: str, folder: Path) -> None:
    command = [sys.executable, "-P", str(_CHILD), job, str(path), str(folder)]
    try:
        child = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=_longest_time(path))
    except subprocess.TimeoutExpired as error:
        raise FileFormatError(f"{path} is damaged: {_ENDLESS}; {_remedy(path)}") from error
    if child.returncode == 0:
        return
    if child.returncode == REFUSED:
        lines = child.stderr.decode("utf-8", "replace").splitlines() or ["it cannot be read"]
        raise FileFormatError(f"{path} is damaged: {lines[-1]}; {_remedy(path)}")
    raise FileFormatError(f"{path} is damaged: {_CRASHED}; {_remedy(path)}")


def _heaps_are_valid(path: Path) -> bool:
    """Return whether the first MB of a file, where recordings keep their texts, has global heaps and all are valid.

    (HDF5 File Format Specification Version 3.0, section III.E: signature, version, size, then numbered objects.)
    """
    with path.open("rb") as file:
        data = file.read(1 << 20)
    start, has_heap = data.find(b"GCOL"), False
    while start >= 0:
        if not _is_valid_heap(data, start):
            return False
        has_heap = True
        start = data.find(b"GCOL", start + struct.unpack_from("<Q", data, start + 8)[0])
    return has_heap


def _is_valid_heap(data: bytes, start: int) -> bool:
    header = 16  # bytes of the header of a heap and of an object in it
    if start + header > len(data) or data[start + 4] != 1:
        return False
    end = start + int(struct.unpack_from("<Q", data, start + 8)[0])
    at = start + header
    if not at <= end <= len(data):
        return False
    indices: set[int] = set()
    while end - at >= header:
        index, size = struct.unpack_from("<H6xQ", data, at)
        if index == 0:  # the free space, which must fill the rest
            return bool(size == end - at)
        if index in indices:
            return False
        indices.add(index)
        at += header + size + -size % 8
    return at <= end


def require_stored(samples: h5py.Dataset, name: str, path: Path) -> None:
    """Refuse a damaged size: a table that announces more rows than the file stores would be read as endless zeros."""
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
            raise FileFormatError(f"{path} ends before its samples do; save what is there: {command('recover', path)}")


def rows_within(samples: h5py.Dataset, file_size: int) -> int:
    """Count the leading rows whose bytes lie within a file of ``file_size`` bytes: all, unless the file was cut."""
    n_rows = int(samples.shape[0])
    if samples.chunks is None:
        return n_rows
    for start in range(0, n_rows, samples.chunks[0]):
        try:
            chunk = samples.id.get_chunk_info_by_coord((start, 0))
        except RuntimeError:  # the index of this chunk was not written
            return start
        if chunk.byte_offset is None or chunk.byte_offset + chunk.size > file_size:
            return start
    return n_rows


def open_for_reading(path: Path, *, accept_cut: bool = False) -> h5py.File:
    """Open a recording, also while it is written or after its writer was killed.

    With ``accept_cut`` a file is opened that is shorter than it states; its missing parts must then not be read.
    """
    if not path.is_file():
        raise InputError(f"no file {path}; check the name")
    if superblock(path) is None and h5py.is_hdf5(path):  # an older format, whose metadata have no checksums
        check_in_child(path)
    try:
        return _with_valid_texts(h5py.File(path, "r"), path)
    except OSError:
        pass
    try:
        if is_marked_as_written(path) and is_being_written(path):
            return h5py.File(path, "r", libver="latest", swmr=True)
        if is_marked_as_written(path) or (accept_cut and superblock(path) is not None):
            return _with_valid_texts(h5py.File(UnclosedFile(path), "r"), path)
    except (OSError, ValueError, RuntimeError) as error:
        raise FileFormatError(f"{path} is damaged beyond what a killed writer leaves; {_remedy(path)}") from error
    if advice := conversion_advice(path):
        raise FileFormatError(f"{path} is a file of another program; {advice}")
    remedy = f", or save what is there: {command('recover', path)}" if _is_recoverable(path) else ""
    raise FileFormatError(
        f"{path} is not an HDF5 file, or it was cut short or damaged; copy the whole recording again{remedy}"
    )


def _is_recoverable(path: Path) -> bool:
    """Return whether the checksums of a cut file can be read, without which no sample of it is known to be intact."""
    if has_journal(path):
        return True
    if superblock(path) is None:
        return False
    try:
        with h5py.File(UnclosedFile(path), "r") as file:
            return all(group["blocks"][:].size for group in dict(file["signals"].items()).values())
    except (OSError, ValueError, RuntimeError, KeyError, TypeError, AttributeError):
        return False


def _with_valid_texts(file: h5py.File, path: Path) -> h5py.File:
    """Return the open file if its texts of variable length, which have no checksum, can be read; else close it."""
    try:
        with reporting_damage(path):
            groups = (file, *_subgroups(file.get("signals")), *_subgroups(file.get("events")))
            has_texts = any(_has_variable_text(group) for group in groups)
        if has_texts and not _heaps_are_valid(path):
            check_in_child(path)
    except BaseException:
        file.close()
        raise
    return file


def _subgroups(parent: object) -> list[h5py.Group]:
    if not isinstance(parent, h5py.Group):
        return []
    return [entry for entry in parent.values() if isinstance(entry, h5py.Group)]


def _has_variable_text(group: h5py.Group) -> bool:
    """Return whether an attribute is a text of variable length; only the type is read, not the value."""
    types = (group.attrs.get_id(name).get_type() for name in group.attrs)
    return any(isinstance(kind, h5py.h5t.TypeStringID) and kind.is_variable_str() for kind in types)


@contextmanager
def reporting_damage(path: Path) -> Iterator[None]:
    """Raise a FileFormatError of one line for the errors that the HDF5 library raises on damaged bytes."""
    try:
        yield
    except (KeyError, OSError, RuntimeError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise FileFormatError(f"{path} is damaged: {' '.join(str(error).split())}; {_remedy(path)}") from error


# MAT-File Format (MathWorks), level 5: types of data elements, the bytes of one number of each numeric type, and the
# types in which texts are stored; classes of arrays and the flag of complex numbers.
_MATRIX, _COMPRESSED = 14, 15
_NUMBER_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_TEXT_TYPES = (2, 4, 16)
_CHAR_CLASS, _NUMERIC_CLASSES = 4, range(6, 16)
_COMPLEX_FLAG = 0x800
_HEADER_BYTES = 128
_DEEPEST_NESTING = 64


def is_plain_mat(path: Path) -> bool:
    """Return whether a MAT file holds only numbers and texts of consistent sizes, so that scipy cannot crash.

    The result is also False for other versions of MAT files, which are built differently. A FileFormatError reports an
    element of unknown type, or an element that announces more bytes than there are.
    """
    data = memoryview(path.read_bytes())
    if len(data) < _HEADER_BYTES and bytes(data[:6]) == b"MATLAB":
        raise FileFormatError(f"{path} is damaged: it ends within its header; save it again")
    mark = bytes(data[126:128])
    if mark not in (b"IM", b"MI"):
        return False
    order = "<" if mark == b"IM" else ">"
    try:
        elements = _mat_elements(data[_HEADER_BYTES:], order)
        return all(_is_plain_element(kind, content, order, len(data)) for kind, content in elements)
    except (ValueError, struct.error, zlib.error) as error:
        raise FileFormatError(f"{path} is damaged: {error}; save it again") from error


def _mat_elements(data: memoryview, order: str) -> Iterator[tuple[int, memoryview]]:
    """Yield type and content of consecutive elements; ``order`` is the byte order for `struct`."""
    at = 0
    while len(data) - at >= 8:
        kind, size = struct.unpack_from(order + "II", data, at)
        if kind >> 16:  # a small element: up to four bytes within the tag itself
            kind, size, begin, end = kind & 0xFFFF, kind >> 16, at + 4, at + 8
            if size > 4:
                raise ValueError(f"a small element of {size} bytes")
        else:
            begin = at + 8
            end = begin + size + (0 if kind == _COMPRESSED else -size % 8)
        if kind not in _NUMBER_BYTES and kind not in (_MATRIX, _COMPRESSED):
            raise ValueError(f"an element of unknown type {kind}")
        if begin + size > len(data):
            raise ValueError(f"an element of {size} bytes where {len(data) - begin} are left")
        yield kind, data[begin : begin + size]
        at = end


def _is_plain_element(kind: int, data: memoryview, order: str, file_size: int) -> bool:
    if kind == _COMPRESSED:
        inflater = zlib.decompressobj()
        # the limit keeps a damaged or malicious element from filling the memory
        inflated = inflater.decompress(data, 16 * file_size + 64_000_000)
        if inflater.unconsumed_tail or not inflater.eof:
            raise ValueError("a compressed element that is cut short or expands too far")
        elements = list(_mat_elements(memoryview(inflated), order))
        return len(elements) == 1 and elements[0][0] == _MATRIX and _is_plain_matrix(elements[0][1], order)
    return kind == _MATRIX and _is_plain_matrix(data, order)


def _is_plain_matrix(data: memoryview, order: str, depth: int = 0) -> bool:
    """Return whether an array holds numbers or a text of the size that its dimensions state.

    Nested arrays are only checked for damage.
    """
    if depth > _DEEPEST_NESTING:
        raise ValueError("arrays are nested too deep")
    elements = list(_mat_elements(data, order))
    for kind, content in elements:
        if kind == _MATRIX:
            _is_plain_matrix(content, order, depth + 1)
    # flags (unsigned 32-bit), dimensions (signed 32-bit), name (8-bit), values
    if len(elements) < 4 or [kind for kind, _ in elements[:3]] != [6, 5, 1] or len(elements[0][1]) != 8:
        return False
    flags = struct.unpack(order + "II", elements[0][1])[0]
    n_dimensions = len(elements[1][1]) // 4
    dimensions = struct.unpack(f"{order}{n_dimensions}i", elements[1][1][: 4 * n_dimensions])
    if not 2 <= n_dimensions <= 32 or min(dimensions) < 0:
        return False
    count = math.prod(dimensions)
    values = elements[3:]
    if flags & 0xFF == _CHAR_CLASS:
        return len(values) == 1 and values[0][0] in _TEXT_TYPES and len(values[0][1]) <= 4 * count + 8
    return (
        flags & 0xFF in _NUMERIC_CLASSES
        and len(values) == (2 if flags & _COMPLEX_FLAG else 1)
        and all(kind in _NUMBER_BYTES and len(content) == count * _NUMBER_BYTES[kind] for kind, content in values)
    )
