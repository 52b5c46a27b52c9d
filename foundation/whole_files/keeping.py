"""Files that were there before stay as they are, for as long as somebody says so."""

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import InputError
from .leftovers import is_unfinished


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
    >>> from foundation import writing_whole_file
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
