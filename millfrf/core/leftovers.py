"""Unfinished folders of killed runs: recognised by their lock, and removed."""

import contextlib
import os
import shutil
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

_fcntl: ModuleType | None
try:
    import fcntl as _fcntl
except ImportError:  # Windows: a file that somebody holds open cannot be removed there
    _fcntl = None

PREFIX, SUFFIX = ".millfrf-", ".unfinished"
LOCK = "writer"
"""File in an unfinished folder that its writer holds locked; the lock ends with the process, however that ends."""

_UNLOCKED_SECONDS = 3600.0
"""A folder without that file belongs to a writer that has just begun or died then; after an hour it has died."""


class LeftoverRemoved(UserWarning):
    """What a killed run had left unfinished in a folder was removed."""


def is_unfinished(place: Path) -> bool:
    """Whether a place lies in a folder that is still being written, where everything is the writer's own."""
    return any(part.startswith(PREFIX) and part.endswith(SUFFIX) for part in place.parts)


def take_lock(folder: Path) -> int | None:
    """Lock an unfinished folder for this process.

    Returns
    -------
    int or None
        Descriptor to close when the work is done; None: another run took the folder for a leftover, make a new one.
    """
    try:
        descriptor = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except FileNotFoundError:
        return None
    if _fcntl is None:
        return descriptor
    try:
        _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    except OSError:  # a disk without locks: nobody will take the folder for a leftover
        return descriptor
    if (folder / LOCK).exists():
        return descriptor
    os.close(descriptor)
    return None


def remove_leftovers(folder: Path) -> None:
    """Remove unfinished files whose writers are dead, and warn with `LeftoverRemoved` of each.

    Parameters
    ----------
    folder
        Folder that is about to be written to.
    """
    try:
        found = [entry for entry in folder.iterdir() if entry.name.startswith(PREFIX) and entry.name.endswith(SUFFIX)]
    except OSError:  # a folder that may be written to and not be listed
        return
    for leftover in found:
        with _held_if_dead(leftover) as dead:
            if not dead:
                continue
            files = [file for file in leftover.rglob("*") if file.is_file() and file.name != LOCK]
            size = sum(file.stat().st_size for file in files)
            names = ", ".join(sorted({file.relative_to(leftover).parts[0] for file in files}))
            shutil.rmtree(leftover, ignore_errors=True)
        if files and not leftover.exists():
            warnings.warn(
                f"removed {leftover}, unfinished {names} of a run that was killed ({size} bytes)",
                LeftoverRemoved,
                stacklevel=2,
            )


@contextlib.contextmanager
def _held_if_dead(leftover: Path) -> Iterator[bool]:
    """Whether the writer is dead; its lock is held meanwhile, so that only one run removes what it left."""
    try:
        descriptor = os.open(leftover / LOCK, os.O_RDWR)
    except FileNotFoundError:
        yield _is_old(leftover)
        return
    except OSError:  # another user's
        yield False
        return
    try:
        yield _is_free(descriptor, leftover)
    finally:
        with contextlib.suppress(OSError):
            os.close(descriptor)


def _is_free(descriptor: int, leftover: Path) -> bool:
    if _fcntl is None:
        os.close(descriptor)
        try:
            (leftover / LOCK).unlink()
        except OSError:  # held open by its writer
            return False
        return True
    try:
        _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
    except OSError:  # held by its writer, or a disk without locks
        return False
    return True


def _is_old(leftover: Path) -> bool:
    try:
        return time.time() - leftover.stat().st_mtime > _UNLOCKED_SECONDS
    except OSError:
        return False
