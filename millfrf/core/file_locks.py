"""Locks of files: they state that a writer lives, and end with its process."""

import os
from pathlib import Path
from types import ModuleType

_fcntl: ModuleType | None
try:
    import fcntl as _fcntl
except ImportError:  # Windows, where a file that a process has open can be neither removed nor replaced
    _fcntl = None

HAS_LOCKS = _fcntl is not None


def lock(descriptor: int, *, shared: bool = False) -> bool | None:
    """Lock an open file for this process until the descriptor is closed.

    Parameters
    ----------
    descriptor
        Descriptor of the open file.
    shared
        Whether others may have a shared lock, too, as HDF5's readers of a recording that is written.

    Returns
    -------
    bool or None
        False: another program has the lock; None: the system or the disk has no locks.
    """
    if _fcntl is None:
        return None
    try:
        _fcntl.flock(descriptor, (_fcntl.LOCK_SH if shared else _fcntl.LOCK_EX) | _fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # some network disks
        return None
    return True


def is_being_written(path: Path) -> bool:
    """Return whether a running program writes a file in place; False if the system has no such locks.

    The writer of a recording shares its lock with readers, and HDF5 marks the file as being written. A shared lock on a
    file without that mark is that of a reader.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:  # it is not there, or may not be read
        return False
    try:
        if lock(descriptor) is not False:
            return False
        return lock(descriptor, shared=True) is False or is_marked(path)
    finally:
        os.close(descriptor)


_SIGNATURE, _FLAGS = b"\x89HDF\r\n\x1a\n", 11  # of HDF5's superblock; versions 2 and 3 have the flags at this byte


def is_marked(path: Path) -> bool:
    """Return whether HDF5 has marked a file as being written: its writer lives, was killed, or could not close it."""
    with path.open("rb") as file:
        head = file.read(_FLAGS + 1)
    return head.startswith(_SIGNATURE) and len(head) > _FLAGS and head[8] >= 2 and head[_FLAGS] != 0
