"""Reading a session file: every mistake in one line that a lab user understands."""

import os
import tomllib
from pathlib import Path

from pydantic import ValidationError

from foundation import FileFormatError, InputError, mistake_in_words

from .tables import Session

_DRIVERS = {
    "union_tag_not_found": ".driver is missing; use ni, replay or simulated",
    "union_tag_invalid": ".driver is not known; use ni, replay or simulated",
}
_LARGEST = 1_000_000


def read_session(path: str | os.PathLike[str]) -> Session:
    """Read and check a session file.

    Raises
    ------
    InputError
        No such file, or a value that cannot be: the line names the key, the value and the remedy.
    FileFormatError
        Not TOML.
    """
    return session_from_text(session_text(path), os.fspath(path))


def session_text(path: str | os.PathLike[str]) -> str:
    """The file's text, to be kept in the recording.

    Raises
    ------
    InputError, FileFormatError
    """
    file = Path(path)
    if not file.is_file():
        raise InputError(f"no session file {path}; check the name")
    if file.stat().st_size > _LARGEST:
        raise FileFormatError(f"{path} has {file.stat().st_size} bytes; that is no session file")
    try:
        return file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise FileFormatError(f"{path} is not text in UTF-8; save it so") from error


def session_from_text(text: str, name: str = "session") -> Session:
    """Check a session given as text.

    Raises
    ------
    InputError, FileFormatError
    """
    try:
        content = tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        raise FileFormatError(f"{name} is not TOML: {' '.join(str(error).split())}") from error
    try:
        return Session.model_validate(content)
    except ValidationError as error:
        raise InputError(f"{name}: {mistake_in_words(error, Session, _DRIVERS)}") from error
