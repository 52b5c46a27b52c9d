"""Reading of damaged files: checks before the library opens them, and readers in a process of their own."""

import faulthandler
import json
import multiprocessing
import os
import struct
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np

from millfrf.core import FileFormatError, InputError, conversion_advice, end_with

from .durability import is_being_written
from .reading_child import attempt
from .unclosed_file import UnclosedFile, is_marked_as_written, superblock

_CHILD = Path(__file__).with_name("reading_child.py")
_REFUSED = 3
_WALL_SECONDS = 60.0
_BYTES_A_SECOND = 2e6
_LONGEST_REPORT = 1000
_ENDLESS = "reading it does not come to an end; take a copy of it"
_CRASHED = "reading it crashes or does not come to an end; take a copy of it"
_rehearsed: set[tuple[str, int, int]] = set()


def read_guarded(path: Path, job: Literal["mat", "arrays"]) -> dict[str, Any]:
    """Arrays and texts of a file by name; a cell of texts is an array of texts, what else there is an empty array.

    Raises
    ------
    FileFormatError
        The file is damaged.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run(path, job, folder)
        fields: dict[str, Any] = {}
        for entry in json.loads((folder / "index.json").read_text(encoding="utf-8")):
            if "text" in entry:
                fields[entry["name"]] = entry["text"]
            elif "texts" in entry:
                fields[entry["name"]] = np.array(entry["texts"], dtype=str)
            elif "file" in entry:
                fields[entry["name"]] = np.load(folder / entry["file"], allow_pickle=False)
            else:
                fields[entry["name"]] = np.empty(0, dtype=object)
    return fields


def rehearse(path: Path) -> None:
    """Have a child open a recording and read its structure and texts; once for each state of a file.

    Raises
    ------
    FileFormatError
        It cannot be read, crashed its reader, or did not let it come to an end.
    """
    status = path.stat()
    state = (os.fspath(path.resolve()), status.st_mtime_ns, status.st_size)
    if state in _rehearsed:
        return
    if _can_be_copied():
        _rehearse_in_copy(path)
    else:
        with tempfile.TemporaryDirectory() as folder:
            _run(path, "rehearsal", Path(folder))
    _rehearsed.add(state)


def _can_be_copied() -> bool:
    """Whether a copy of this process can stand in for a new one: no other thread holds a lock of the library."""
    alone = threading.active_count() == 1 and multiprocessing.parent_process() is None
    return sys.platform == "linux" and alone


def _rehearse_in_copy(path: Path) -> None:
    """Rehearse in a copy of this process, which has loaded the libraries: a twentieth of the time of a new one."""
    context = multiprocessing.get_context("fork")
    here, there = context.Pipe(duplex=False)
    copy = context.Process(target=_report_attempt, args=(path, there, os.getpid()), daemon=True)
    copy.start()
    there.close()
    copy.join(_longest(path))
    if copy.is_alive():
        copy.kill()
        copy.join()
        raise FileFormatError(f"{path} is damaged: {_ENDLESS}")
    if copy.exitcode != 0:
        raise FileFormatError(f"{path} is damaged: {_CRASHED}")
    wrong = here.recv_bytes().decode("utf-8", "replace")
    here.close()
    if wrong:
        raise FileFormatError(f"{path} is damaged: {wrong}; take a copy of it")


def _report_attempt(path: Path, pipe: Connection, parent: int) -> None:
    """Runs in the copy, whose libraries may write to standard error when they crash."""
    end_with(parent)
    faulthandler.disable()
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    pipe.send_bytes(attempt("rehearsal", path, path.parent)[:_LONGEST_REPORT].encode())


def _longest(path: Path) -> float:
    """Time within which a file must be read, s."""
    return _WALL_SECONDS + path.stat().st_size / _BYTES_A_SECOND


def _run(path: Path, job: str, folder: Path) -> None:
    command = [sys.executable, "-P", str(_CHILD), job, str(path), str(folder)]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=_longest(path))
    except subprocess.TimeoutExpired as error:
        raise FileFormatError(f"{path} is damaged: {_ENDLESS}") from error
    if done.returncode == 0:
        return
    if done.returncode == _REFUSED:
        lines = done.stderr.decode("utf-8", "replace").splitlines() or ["it cannot be read"]
        raise FileFormatError(f"{path} is damaged: {lines[-1]}; take a copy of it")
    raise FileFormatError(f"{path} is damaged: {_CRASHED}")


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
