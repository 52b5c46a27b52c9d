"""One run at a time in a folder of results: a lock that ends with the process, and what dead runs left removed."""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from millfrf.core import InputError, LeftoverRemoved, remove_leftovers

from ..running import RESULTS, program_digest

_fcntl: ModuleType | None
try:
    import fcntl as _fcntl
except ImportError:  # Windows
    _fcntl = None

LOCK, PROGRAM = ".running", ".program"

WRITTEN = ("report.html", "modes.csv", "modes.parquet", "tasks.csv", "failures.csv", "doubts.csv", "recordings.json")
"""Files that every run writes anew into its folder: in a folder of something else they may be a user's own."""


@contextmanager
def only_run(out: Path) -> Iterator[None]:
    """Hold the folder of results for this run, made if need be.

    Raises
    ------
    InputError
        Another run works there, the folder cannot be made or written to, or it holds files that a run would replace
        and no campaign has written.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file; name a folder with --out")
    _refuse_foreign(out)
    try:
        out.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(out / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise InputError(f"cannot write into {out}: {error.strerror}; choose another --out") from error
    try:
        if _fcntl is not None:
            try:
                _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise InputError(f"another run works in {out}; wait for it, or choose another --out") from error
            except OSError:  # a disk without locks
                pass
        _remove_unfinished(out)
        (out / PROGRAM).write_text(program_digest(), encoding="utf-8")
        yield
    finally:
        os.close(descriptor)


def _refuse_foreign(out: Path) -> None:
    if (out / LOCK).exists() or (out / RESULTS).is_dir():
        return
    found = [name for name in WRITTEN if (out / name).exists()]
    if found:
        raise InputError(f"{out / found[0]} exists and is of no campaign; name another folder with --out")


def program_changed(out: Path) -> bool:
    """Whether the last run in a folder was one of another version, whose results do not count now."""
    try:
        return (out / PROGRAM).read_text(encoding="utf-8") != program_digest()
    except OSError:
        return False


def _remove_unfinished(out: Path) -> None:
    """Remove what killed workers left unfinished in the store; those of living ones stay."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", LeftoverRemoved)
        for folder in (out, *(out / RESULTS).glob("*/*")):
            if folder.is_dir():
                remove_leftovers(folder)
