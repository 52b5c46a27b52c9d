"""Files and folders that appear completely or not at all, also when the disk is full or the program is killed.

A file is made in an unfinished folder in the folder of its target, and renamed when it is complete. The folder holds a
file that its writer keeps locked, so that a later run recognises and removes the folders of killed runs.
"""

import contextlib
import os
import re
import shutil
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType

from .errors import DiskFull, InputError

_fcntl: ModuleType | None
try:
    import fcntl as _fcntl
except ImportError:  # Windows, where a file that a process has open cannot be removed: that is the lock there
    _fcntl = None

PREFIX, SUFFIX = ".millfrf-", ".unfinished"
LOCK = "writer"  # file of an unfinished folder that its writer keeps locked; the lock ends with the process
_UNLOCKED_SECONDS = 3600.0  # a folder without that file may be just beginning; after an hour its writer is dead
_FULL = {28, 122, 27}  # ENOSPC, EDQUOT, EFBIG


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
    if _fcntl is None:
        return descriptor
    try:
        _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        return None
    except OSError:  # a disk without locks: no other run will remove the folder
        return descriptor
    if (folder / LOCK).exists():
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
    if _fcntl is None:
        os.close(descriptor)
        try:
            (leftover / LOCK).unlink()
        except OSError:  # open in its writer
            return False
        return True
    try:
        _fcntl.flock(descriptor, _fcntl.LOCK_EX | _fcntl.LOCK_NB)
    except OSError:  # locked by its writer, or a disk without locks
        return False
    return True


def _is_old(leftover: Path) -> bool:
    try:
        return time.time() - leftover.stat().st_mtime > _UNLOCKED_SECONDS
    except OSError:
        return False


def is_disk_full(error: BaseException) -> bool:
    """Return whether an error, or the error that caused it, states that the disk is full.

    Examples
    --------
    >>> is_disk_full(RuntimeError("Unable to flush (file write failed: errno = 28, error message = 'No space left')"))
    True
    >>> is_disk_full(ValueError("errno = 5"))
    False
    """
    stated = re.search(r"errno = (\d+)", str(error))  # HDF5 states the number in its text alone
    is_full = getattr(error, "errno", None) in _FULL or (stated is not None and int(stated.group(1)) in _FULL)
    return is_full or (error.__cause__ is not None and is_disk_full(error.__cause__))


@contextmanager
def naming_full_disk(target: Path) -> Iterator[None]:
    """Convert any error about a full disk to `DiskFull`, with one line that names the file to be written."""
    try:
        yield
    except Exception as error:
        if isinstance(error, DiskFull) or is_disk_full(error):
            raise DiskFull(
                f"no room for {target}: its disk or quota is full, or holds no file of that size; nothing was written, "
                "make room or choose another folder"
            ) from error
        raise


@dataclass(frozen=True)
class _Protection:
    """Remedy if a file exists already (None: it may be replaced), and the files written within the block."""

    remedy: str | None
    written: dict[Path, Path] = field(default_factory=dict)


_protection: ContextVar[_Protection | None] = ContextVar("protection", default=None)


@contextmanager
def keeping_files(remedy: str | None) -> Iterator[Callable[[], list[Path]]]:
    """Refuse to replace, within the block, files that existed before; files written in the block may be replaced.

    Parameters
    ----------
    remedy
        What a user can do about it; it ends the line that names the file. None: files may be replaced.

    Yields
    ------
    Callable
        Returns the files that the block has written so far, as they were named, in their order.

    Examples
    --------
    >>> import tempfile
    >>> from millfrf.core import writing_whole_file
    >>> place = Path(tempfile.mkdtemp()) / "a.txt"
    >>> _ = place.write_text("mine")
    >>> try:
    ...     with keeping_files("choose another name"), writing_whole_file(place) as temporary:
    ...         _ = temporary.write_text("other")
    ... except InputError as error:
    ...     print(str(error).replace(str(place), "a.txt"), "|", place.read_text())
    a.txt exists; choose another name | mine
    """
    protection = _Protection(remedy)
    token = _protection.set(protection)
    try:
        yield lambda: [named for real, named in protection.written.items() if real.is_file()]
    finally:
        _protection.reset(token)


def keeps_files() -> bool:
    """Return whether existing files must not be replaced."""
    protection = _protection.get()
    return protection is not None and protection.remedy is not None


def refuse_replacing(path: str | os.PathLike[str]) -> None:
    """Raise `InputError` for a file, or a folder with files, that must not be replaced."""
    protection, place = _protection.get(), Path(path)
    if protection is None or protection.remedy is None or is_unfinished(place):
        return
    if not place.exists() or _real(place) in protection.written:
        return
    if place.is_dir() and not any(place.iterdir()):
        return
    raise InputError(f"{path} exists; {protection.remedy}")


def note_made(paths: Iterable[Path]) -> None:
    """Register files that were just written, so that the same block may replace them."""
    protection = _protection.get()
    if protection is not None:
        protection.written.update({_real(path): path for path in paths if not is_unfinished(path)})


def free_name(path: Path) -> Path:
    """Return a name; if its file must not be replaced, return the next free name: ``a-2.html``, ``a-3.html``.

    Parameters
    ----------
    path
        Name that the program chose, not the user.
    """
    if not keeps_files() or not path.exists():
        return path
    number = 2
    while (place := path.with_name(f"{path.stem}-{number}{path.suffix}")).exists():
        number += 1
    return place


def _real(path: Path) -> Path:
    return Path(os.path.realpath(path))


@contextmanager
def writing_whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path; rename its file to ``path`` when the block succeeds.

    The file is on the disk before it gets its name, and the name is on the disk when the block ends. Unfinished files
    of killed runs in the same folder are removed, with the warning `LeftoverRemoved`.

    Parameters
    ----------
    path
        Final place of the finished file. Its folder must exist.

    Yields
    ------
    Path
        Name of a file to be made, on the same disk (so that the rename is atomic), with the same name as the target.

    Raises
    ------
    InputError
        The folder does not exist or cannot be written to, the name is that of a folder or a device, or of a file that
        must not be replaced (`keeping_files`).
    DiskFull
        The disk is full; an old file of that name is unchanged.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> with writing_whole_file(folder / "a.txt") as temporary:
    ...     _ = temporary.write_text("whole")
    >>> [f.name for f in folder.iterdir()]
    ['a.txt']
    """
    target = Path(os.path.realpath(path))  # what a link points to is replaced, not the link
    if not target.parent.is_dir():
        raise InputError(f"cannot write {path}: folder {Path(path).parent} does not exist; create it first")
    if target.is_dir():
        raise InputError(f"cannot write {path}: it is a folder; give a file name")
    if target.exists() and not target.is_file():
        raise InputError(f"cannot write {path}: it is a device, which cannot be replaced whole; give a file name")
    refuse_replacing(path)
    with _unfinished(target, Path(path)) as (folder, nested):
        temporary = folder / target.name
        yield temporary
        if not nested:
            _sync(temporary)
        refuse_replacing(path)  # another program may have made it meanwhile
        _put_in_place(temporary, target)
        note_made([Path(path)])
        if not nested:
            _sync(target.parent)


@contextmanager
def writing_whole_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary folder; when the block succeeds, move its content into the folder ``path``.

    A new folder appears with all its files at once. If the folder exists, the files are moved into it one after another
    when all are written; each file replaces a file of the same name, and further files are kept.

    Parameters
    ----------
    path
        Final place of the folder; its parents are made.

    Yields
    ------
    Path
        Empty folder on the same disk.

    Raises
    ------
    InputError
        There is a file of that name, the folder cannot be made or written to, or a file in it must not be replaced
        (`keeping_files`).
    DiskFull
        The disk is full; nothing was moved.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_dir():
        raise InputError(f"{path} is a file; name a folder with --out")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make the folder {path}: {error.strerror}; choose another --out") from error
    if target.is_dir():
        remove_leftovers(target)
    with _unfinished(target, Path(path)) as (folder, _):
        temporary = folder / target.name
        temporary.mkdir()
        yield temporary
        _sync_all(temporary)
        places = [Path(path) / file.relative_to(temporary) for file in temporary.rglob("*") if not file.is_dir()]
        for place in places:
            refuse_replacing(place)
        if target.is_dir():
            _move_into(temporary, target)
        else:
            _put_in_place(temporary, target)
        note_made(places)
        _sync(target.parent)


@contextmanager
def _unfinished(target: Path, stated: Path) -> Iterator[tuple[Path, bool]]:
    """Yield a locked folder next to the target, and whether it lies in an unfinished folder; remove it after use."""
    nested = is_unfinished(target.parent)
    if not nested:
        remove_leftovers(target.parent)
    with naming_full_disk(stated):
        folder, lock = _make_unfinished(target, stated)
        try:
            yield folder, nested
        finally:
            os.close(lock)
            shutil.rmtree(folder, ignore_errors=True)


def _make_unfinished(target: Path, stated: Path) -> tuple[Path, int]:
    try:
        while True:
            folder = Path(tempfile.mkdtemp(dir=target.parent, prefix=PREFIX, suffix=SUFFIX))
            lock = take_lock(folder)
            if lock is not None:
                return folder, lock
    except OSError as error:
        if is_disk_full(error):
            raise DiskFull(str(stated)) from error
        raise InputError(f"cannot write {stated}: {error.strerror}; choose another folder") from error


def _put_in_place(temporary: Path, target: Path) -> None:
    try:
        temporary.replace(target)
    except PermissionError as error:
        raise InputError(
            f"cannot replace {target}: {error.strerror}; close the program that has it open, or choose another name"
        ) from error


def _move_into(folder: Path, target: Path) -> None:
    """Move every file to the same relative path below an existing folder."""
    for entry in sorted(folder.iterdir()):
        place = target / entry.name
        if entry.is_dir() and place.is_dir():
            _move_into(entry, place)
        else:
            _put_in_place(entry, place)
    _sync(target)


def _sync_all(folder: Path) -> None:
    for entry in folder.rglob("*"):
        _sync(entry)
    _sync(folder)


def _sync(path: Path) -> None:
    """Write a file, or a folder's list of names, from memory to the disk; ignore errors except a full disk."""
    try:
        descriptor = os.open(path, os.O_RDONLY if path.is_dir() or os.name != "nt" else os.O_RDWR)
    except PermissionError:  # Windows opens no folders
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        if is_disk_full(error):
            raise
    finally:
        with contextlib.suppress(OSError):
            os.close(descriptor)
