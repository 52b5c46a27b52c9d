"""Unfinished folders, in which files are made before they get their names.

A folder holds a file that its writer keeps locked, so that a later run recognises and removes the folders of killed
runs.
"""

import contextlib
import os
import shutil
import time
import warnings
from collections.abc import Iterator
from pathlib import Path

from .file_locks import HAS_LOCKS, lock

PREFIX, SUFFIX = ".millfrf-", ".unfinished"  # of the folders' names, which messages do not show
LOCK = "writer"  # file of an unfinished folder that its writer keeps locked; the lock ends with the process
_UNLOCKED_SECONDS = 3600.0  # a folder without that file may be just beginning; after an hour its writer is dead


class LeftoverRemoved(UserWarning):
    """The unfinished files of a killed run were removed from a folder."""


def is_unfinished(place: Path) -> bool:
    """Return whether a path lies in an unfinished folder, in which only the writer of the folder has files."""
    return any(part.startswith(PREFIX) and part.endswith(SUFFIX) for part in place.parts)


def take_lock(folder: Path) -> int | None:
    """Lock an unfinished folder for this process, and return the descriptor to close when the work is done.

    None is returned if another run is removing the folder as a leftover of a killed run; then make a new folder.
    """
    try:
        descriptor = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
    except FileNotFoundError:
        return None
    taken = lock(descriptor)
    if taken is None:  # without locks, no other run will remove the folder
        return descriptor
    if taken and (folder / LOCK).exists():
        return descriptor
    os.close(descriptor)
    return None


def remove_leftovers(folder: Path) -> None:
    """Remove from a folder the unfinished files whose writers are dead, and warn of each with `LeftoverRemoved`."""
    try:
        unfinished = [
            entry for entry in folder.iterdir() if entry.name.startswith(PREFIX) and entry.name.endswith(SUFFIX)
        ]
    except OSError:  # a folder that may be written to and not be listed
        return
    for leftover in unfinished:
        with _locked_if_dead(leftover) as dead:
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
def _locked_if_dead(leftover: Path) -> Iterator[bool]:
    """Yield whether the writer of a folder is dead; hold its lock meanwhile, so that only one run removes it."""
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
    if HAS_LOCKS:
        return lock(descriptor) is True  # not on a disk without locks
    os.close(descriptor)
    try:
        (leftover / LOCK).unlink()
    except OSError:  # open in its writer
        return False
    return True


def _is_old(leftover: Path) -> bool:
    try:
        return time.time() - leftover.stat().st_mtime > _UNLOCKED_SECONDS
    except OSError:
        return False
