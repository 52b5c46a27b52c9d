"""Disks that are full or fail: which errors say so, and files written from memory to the disk."""

import contextlib
import errno
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import DiskError, DiskFull, NotKept
from .unfinished_folders import PREFIX

_FULL = {errno.ENOSPC, errno.EFBIG, getattr(errno, "EDQUOT", errno.ENOSPC)}
# a disk that fails, was pulled, was mounted read-only after an error, or whose server is gone
_FAILED = {
    getattr(errno, name)
    for name in ("EIO", "ENXIO", "ENODEV", "EROFS", "ESTALE", "EREMOTEIO", "ENOTCONN", "ESHUTDOWN", "ETIMEDOUT")
    if hasattr(errno, name)
}
_NO_SYNC = {errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP}  # a disk that has no such operation


def _numbers(error: BaseException) -> set[int]:
    """Return the numbers of the system's errors that an error, and the error that caused it, state."""
    stated = re.search(r"errno = (\d+)", str(error))  # HDF5 states the number in its text alone
    numbers = {int(stated.group(1))} if stated is not None else set()
    if isinstance(error, OSError) and error.errno is not None:
        numbers.add(error.errno)
    return numbers | (_numbers(error.__cause__) if error.__cause__ is not None else set())


def is_disk_full(error: BaseException) -> bool:
    """Return whether an error, or the error that caused it, states that the disk is full.

    Examples
    --------
    >>> is_disk_full(RuntimeError("Unable to flush (file write failed: errno = 28, error message = 'No space left')"))
    True
    >>> is_disk_full(ValueError("errno = 5"))
    False
    """
    return bool(_numbers(error) & _FULL)


def failure_of_disk(error: BaseException) -> str:
    """Return the system's words for the failure of a disk that an error or its cause states; empty if it states none.

    Examples
    --------
    >>> failure_of_disk(OSError(5, "Input/output error")) == os.strerror(5)
    True
    >>> failure_of_disk(ValueError("negative"))
    ''
    """
    failures = sorted(_numbers(error) & _FAILED)
    return os.strerror(failures[0]) if failures else ""


@contextmanager
def replacing_several(folder: Path) -> Iterator[None]:
    """State that some files of a folder may be new and some old, if the disk fails within the block."""
    try:
        yield
    except OSError as error:
        if not (is_disk_full(error) or failure_of_disk(error)):
            raise
        raise DiskError(
            f"the disk of {folder} failed ({error.strerror}) while the files there were replaced: some may be new and "
            "some old; check the disk, and run the command again into another folder"
        ) from error


@contextmanager
def naming_disk_errors(target: Path) -> Iterator[None]:
    """Convert any error about a full or failing disk to one line that names the file to be written."""
    try:
        yield
    except Exception as error:
        if isinstance(error, DiskError) and PREFIX not in str(error):
            raise  # it names a file itself, which may be another one
        if isinstance(error, DiskFull) or is_disk_full(error):
            raise DiskFull(
                f"no room for {target}: its disk or quota is full, or holds no file of that size; nothing was written, "
                "make room or choose another folder"
            ) from error
        failure = failure_of_disk(error)
        if isinstance(error, NotKept) and not failure:
            raise NotKept(f"{target} was removed or replaced by another program while it was written") from error
        if isinstance(error, DiskError) or failure:
            reason = failure or "a write failed"
            raise DiskError(
                f"the disk of {target} failed ({reason}); the file was not written, check the disk or choose another "
                "folder"
            ) from error
        raise


def sync(path: Path) -> None:
    """Write a file, or a folder's list of names, from memory to the disk.

    Raises
    ------
    OSError
        The disk did not take it; what was written before is lost with the next power failure, or sooner.
    """
    try:
        descriptor = os.open(path, os.O_RDONLY if path.is_dir() or os.name != "nt" else os.O_RDWR)
    except PermissionError:  # Windows opens no folders
        return
    try:
        sync_open(descriptor)
    finally:
        with contextlib.suppress(OSError):
            os.close(descriptor)


def sync_open(descriptor: int) -> None:
    """Write an open file from memory to the disk; see :func:`sync`."""
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _NO_SYNC:
            raise


def sync_name(path: Path) -> None:
    """Write the name of a file that was put in place to the disk.

    Raises
    ------
    NotKept
        The disk did not take it.
    """
    try:
        sync(path.parent)
    except OSError as error:
        raise NotKept(
            f"{path} was written, but its disk failed to keep the name ({error.strerror}): the file may be lost with "
            "the next power failure; check the disk, and run the command again with --force"
        ) from error
