"""Files and folders that appear completely or not at all, also when the disk is full or the program is killed."""

import contextlib
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from .errors import DiskFull, InputError
from .leftovers import PREFIX, SUFFIX, is_unfinished, remove_leftovers, take_lock

_FULL = {28, 122, 27}  # ENOSPC, EDQUOT, EFBIG


def is_disk_full(error: BaseException) -> bool:
    """Whether the HDF5 library or the system says, or said to what is raised now, that there is no more room.

    Examples
    --------
    >>> is_disk_full(RuntimeError("Unable to flush (file write failed: errno = 28, error message = 'No space left')"))
    True
    >>> is_disk_full(ValueError("errno = 5"))
    False
    """
    found = re.search(r"errno = (\d+)", str(error))
    says_so = getattr(error, "errno", None) in _FULL or (found is not None and int(found.group(1)) in _FULL)
    return says_so or (error.__cause__ is not None and is_disk_full(error.__cause__))


@contextmanager
def naming_full_disk(target: Path) -> Iterator[None]:
    """Turn whatever a library says of a full disk into one line that names the wanted file.

    Raises
    ------
    DiskFull
        No room was left for it.
    """
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
class _Keeping:
    """What to advise where a file is in the way (None: it may be replaced), and the files that appeared meanwhile."""

    remedy: str | None
    made: dict[Path, Path] = field(default_factory=dict)


_kept: ContextVar[_Keeping | None] = ContextVar("kept", default=None)


@contextmanager
def keeping_files(remedy: str | None) -> Iterator[Callable[[], list[Path]]]:
    """Refuse to replace, within the block, a file that was there before it; files that the block made may change.

    Parameters
    ----------
    remedy
        What a user can do about it; it ends the line that names the file. None: files may be replaced.

    Yields
    ------
    Callable
        Gives the files that the block has made so far, as they were named, in their order.

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
    keeping = _Keeping(remedy)
    token = _kept.set(keeping)
    try:
        yield lambda: [named for real, named in keeping.made.items() if real.is_file()]
    finally:
        _kept.reset(token)


def keeps_files() -> bool:
    """Whether files that are there must stay."""
    keeping = _kept.get()
    return keeping is not None and keeping.remedy is not None


def refuse_replacing(path: str | os.PathLike[str]) -> None:
    """Refuse a place where a file or a folder with files is that must stay; elsewhere do nothing.

    Raises
    ------
    InputError
        With the path and the remedy.
    """
    keeping, place = _kept.get(), Path(path)
    if keeping is None or keeping.remedy is None or is_unfinished(place):
        return
    if not place.exists() or _real(place) in keeping.made:
        return
    if place.is_dir() and not any(place.iterdir()):
        return
    raise InputError(f"{path} exists; {keeping.remedy}")


def note_made(paths: Iterable[Path]) -> None:
    """Remember files that have just appeared: whoever made them may complete them."""
    keeping = _kept.get()
    if keeping is not None:
        keeping.made.update({_real(path): path for path in paths if not is_unfinished(path)})


def free_name(path: Path) -> Path:
    """The name itself, or where it is taken and files must stay, the next with a number: ``a-2.html``, ``a-3.html``.

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
