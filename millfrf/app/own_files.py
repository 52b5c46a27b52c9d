"""Files that the page itself writes: it replaces its own, and never one of the user's."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from millfrf.core import InputError, keeping_files, writing_whole_file

MARK = "# From the page of millfrf app"
_MARKS = (MARK, "# Poles picked in the browser")


@contextmanager
def replacing_own(path: Path) -> Iterator[None]:
    """Allow a file to be replaced within the block if the page has written it before.

    Raises
    ------
    InputError
        A file of the user has this name.
    """
    if path.exists():
        with path.open("rb") as file:
            beginning = file.readline(200).decode("utf-8", "replace")
        if not beginning.startswith(_MARKS):
            raise InputError(f"{path.name} is there, and is no file of this page; rename it, or choose another name")
    with keeping_files(None):
        yield


def write_own(path: Path, text: str, about: str) -> None:
    """Write a TOML file of the page.

    Parameters
    ----------
    path
        File.
    text
        Its content.
    about
        What it is, for its first line.

    Raises
    ------
    InputError
        A file of the user has this name.
    """
    with replacing_own(path), writing_whole_file(path) as temporary:
        Path(temporary).write_text(f"{MARK}: {about}\n{text}", encoding="utf-8")


def store_dropped(folder: Path, name: str, content: bytes) -> Path:
    """Write a file that was dropped on the page into a folder, under its own name only.

    Raises
    ------
    InputError
        Another file has this name, or it is no name.
    """
    path = folder / Path(name.replace("\\", "/")).name
    if path.name.startswith(".") or path == folder:
        raise InputError(f"{name!r} is no name of a file; rename it")
    if path.exists() and path.read_bytes() != content:
        raise InputError(f"{path.name} is there with another content; rename one of them")
    with keeping_files(None), writing_whole_file(path) as temporary:
        Path(temporary).write_bytes(content)
    return path
