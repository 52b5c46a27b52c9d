"""Files and folders appear whole or not at all: written in an unfinished folder beside their place, then renamed."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import DiskFull, InputError
from .full_disk import is_disk_full, naming_full_disk
from .keeping import note_made, refuse_replacing
from .leftovers import PREFIX, SUFFIX, is_unfinished, remove_leftovers, take_lock


@contextmanager
def writing_whole_file(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path; rename it to ``path`` when the block succeeds.

    The file is on the disk before it gets its name, and the name is on the disk when the block ends. What a killed run
    left unfinished in the same folder is removed, with the warning `LeftoverRemoved`.

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
        must stay (`keeping_files`).
    DiskFull
        No room was left; an old file of that name is as it was.

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
        refuse_replacing(path)  # it may have come up meanwhile
        _put_in_place(temporary, target)
        note_made([Path(path)])
        if not nested:
            _sync(target.parent)


@contextmanager
def writing_whole_folder(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary folder; when the block succeeds everything in it gets its place in the folder ``path``.

    A folder that was not there appears with all its files at once. Into one that was there, the files are moved one
    after the other once all are written; each replaces a file of its name, others stay.

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
        There is a file of that name, the folder cannot be made or written to, or a file in it that would be replaced
        must stay (`keeping_files`).
    DiskFull
        No room was left; nothing was moved.
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
def _unfinished(target: Path, said: Path) -> Iterator[tuple[Path, bool]]:
    """A locked folder beside the target, removed in the end; and whether it lies in another unfinished one."""
    nested = is_unfinished(target.parent)
    if not nested:
        remove_leftovers(target.parent)
    with naming_full_disk(said):
        folder, lock = _make_unfinished(target, said)
        try:
            yield folder, nested
        finally:
            os.close(lock)
            shutil.rmtree(folder, ignore_errors=True)


def _make_unfinished(target: Path, said: Path) -> tuple[Path, int]:
    try:
        while True:
            folder = Path(tempfile.mkdtemp(dir=target.parent, prefix=PREFIX, suffix=SUFFIX))
            lock = take_lock(folder)
            if lock is not None:
                return folder, lock
    except OSError as error:
        if is_disk_full(error):
            raise DiskFull(str(said)) from error
        raise InputError(f"cannot write {said}: {error.strerror}; choose another folder") from error


def _put_in_place(temporary: Path, target: Path) -> None:
    try:
        temporary.replace(target)
    except PermissionError as error:
        raise InputError(
            f"cannot replace {target}: {error.strerror}; close the program that has it open, or choose another name"
        ) from error


def _move_into(folder: Path, target: Path) -> None:
    """Move every file to its place below an existing folder."""
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
    """Have the system put a file, or a folder's list of names, on the disk itself; where it cannot, it does so later.

    Raises
    ------
    OSError
        The disk turned out to be full.
    """
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
