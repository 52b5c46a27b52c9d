"""Files and folders that appear completely or not at all, also when the disk is full or the program is killed.

A file is made in an unfinished folder in the folder of its target, and renamed when it is complete.
"""

import errno
import os
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from .disk_errors import failure_of_disk, is_disk_full, naming_disk_errors, replacing_several, sync, sync_name
from .errors import DiskError, InputError, NotKept
from .file_locks import is_being_written
from .unfinished_folders import PREFIX, SUFFIX, is_unfinished, remove_leftovers, take_lock


@dataclass(frozen=True)
class _Written:
    """A file that was written: its path as it was named, and what the system states of it."""

    named: Path
    stat: os.stat_result

    def is_there(self) -> bool:
        """Return whether the path still is that file; some network disks change the number or the time of a file."""
        try:
            now = self.named.stat()
        except OSError:
            return False
        is_same = now.st_ino == self.stat.st_ino or now.st_mtime_ns == self.stat.st_mtime_ns
        return is_same and now.st_size == self.stat.st_size


@dataclass(frozen=True)
class _Protection:
    """Remedy if a file exists already (None: it may be replaced), and the files written within the block."""

    remedy: str | None
    written: dict[Path, _Written] = field(default_factory=dict)


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

    Raises
    ------
    DiskError
        At the end of the block, a file is no longer what the block has written.

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
        yield lambda: [written.named for real, written in protection.written.items() if real.is_file()]
        require_as_written(protection.written)
    finally:
        _protection.reset(token)


def keeps_files() -> bool:
    """Return whether existing files must not be replaced."""
    protection = _protection.get()
    return protection is not None and protection.remedy is not None


def refuse_replacing(path: str | os.PathLike[str]) -> None:
    """Raise `InputError` for a file, or a folder with files, that must not be replaced or that is being written."""
    protection, place = _protection.get(), Path(path)
    if is_unfinished(place) or not place.exists():
        return
    is_kept = protection is not None and protection.remedy is not None and _real(place) not in protection.written
    if protection is not None and is_kept and not (place.is_dir() and not any(place.iterdir())):
        raise InputError(f"{path} exists; {protection.remedy}")
    refuse_busy(place)


def refuse_busy(path: Path) -> None:
    """Raise `InputError` for a file that another program is writing in place, such as a running recording."""
    if path.is_file() and is_being_written(path):
        raise InputError(f"{path} is being written by another program; choose another name or wait for it")


def note_made(path: Path, stat: os.stat_result) -> None:
    """Register a file that was just written: the same block may replace it, and it must stay to the end of the block.

    Raises
    ------
    NotKept
        It is not there any more.
    """
    written, protection = _Written(path, stat), _protection.get()
    if not written.is_there():
        raise NotKept(f"{path} was removed or replaced by another program as soon as it was written; write it again")
    if protection is not None and not is_unfinished(path):
        protection.written[_real(path)] = written


def require_as_written(paths: Iterable[object]) -> None:
    """Raise `DiskError` if a file, or a file of a folder, is no longer what the block of `keeping_files` has written.

    Texts that name no file of the block are passed over.
    """
    protection = _protection.get()
    if protection is None or not protection.written:
        return
    places = {_real(Path(str(path))) for path in paths}
    for real, written in protection.written.items():
        if not places.isdisjoint((real, *real.parents)) and not written.is_there():
            raise DiskError(
                f"{written.named} is not what this command has written: another program removed, replaced or changed "
                "it meanwhile; run the command again with another name"
            )


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
    DiskFull, DiskError
        The disk is full or failed; an old file of that name is unchanged.

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
            sync(temporary)
        refuse_replacing(path)  # another program may have made it meanwhile
        stat = temporary.stat()
        _put_in_place(temporary, target)
    if not nested:
        sync_name(target)
    note_made(Path(path), stat)


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
    DiskFull, DiskError
        The disk is full or failed; nothing was moved, except where the error says so.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_dir():
        raise InputError(f"{path} is a file; name a folder with --out")
    with naming_disk_errors(Path(path)), _refusing(f"cannot make the folder {path}", "choose another --out"):
        target.parent.mkdir(parents=True, exist_ok=True)
    if target.is_dir():
        remove_leftovers(target)
    with _unfinished(target, Path(path)) as (folder, _):
        temporary = folder / target.name
        temporary.mkdir()
        yield temporary
        for entry in (*temporary.rglob("*"), temporary):
            sync(entry)
        files = [file for file in temporary.rglob("*") if not file.is_dir()]
        written = {Path(path) / file.relative_to(temporary): file.stat() for file in files}
        for place in written:
            refuse_replacing(place)
        if target.is_dir():
            with replacing_several(Path(path)):
                _move_into(temporary, target)
        else:
            _put_in_place(temporary, target)
    sync_name(target)
    for place, stat in written.items():
        note_made(place, stat)


@contextmanager
def _unfinished(target: Path, stated: Path) -> Iterator[tuple[Path, bool]]:
    """Yield a locked folder next to the target, and whether it lies in an unfinished folder; remove it after use."""
    nested = is_unfinished(target.parent)
    if not nested:
        remove_leftovers(target.parent)
    with naming_disk_errors(stated):
        folder, descriptor = _make_unfinished(target, stated)
        try:
            yield folder, nested
        finally:
            os.close(descriptor)
            shutil.rmtree(folder, ignore_errors=True)


def _make_unfinished(target: Path, stated: Path) -> tuple[Path, int]:
    with _refusing(f"cannot write {stated}", "choose another folder"):
        while True:
            folder = Path(tempfile.mkdtemp(dir=target.parent, prefix=PREFIX, suffix=SUFFIX))
            descriptor = take_lock(folder)
            if descriptor is not None:
                return folder, descriptor


@contextmanager
def _refusing(refusal: str, remedy: str) -> Iterator[None]:
    """Convert errors of a folder that may not be written to, which a full or failing disk does not cause."""
    try:
        yield
    except OSError as error:
        if error.errno != errno.EROFS and (is_disk_full(error) or failure_of_disk(error)):
            raise
        raise InputError(f"{refusal}: {error.strerror}; {remedy}") from error


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
    sync(target)
