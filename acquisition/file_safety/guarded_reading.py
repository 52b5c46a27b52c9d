"""Files whose reader may crash, hang or ask for endless memory on damaged bytes are read in a process of their own.

scipy's reader of MAT files and the HDF5 library trust what they read: a flipped bit can end Python itself, or lead them
in a circle (texts of any length lie in HDF5's global heap, which has no checksum; see `text_heap`). A child with limits
of time and memory reads such a file first; nothing it hands over is ever unpickled. The child is a new process, or for
recordings a copy of this one where no other thread runs (Linux), which starts at once.
"""

import faulthandler
import json
import multiprocessing
import os
import subprocess
import sys
import tempfile
import threading
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

import numpy as np

from foundation import FileFormatError, end_with

from .reading_child import attempt

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
