"""Content hashes: a file of results states the hash of its own content, which is compared wherever the file is read.

The hash does not depend on blanks or on the order of fields. A file that was edited after it was written is refused
unless its user accepts it (`accepting_edited`, ``--edited``); then every result that is made from it says so.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from .errors import FileFormatError

HASH = "content_sha256"
"""Field or attribute that holds the hash of all other fields."""

SEALED = ("millfrf.frf", "millfrf.modal_model", "millfrf.diagnosis", "millfrf.chatter")
"""Formats of files that state their hash since version 0.2; older files, and files of other programs, have none."""

EDITED = "edited after it was written"
WITHOUT_HASH = "states no content hash, as files of older versions and other programs"

_accepted: ContextVar[list[str] | None] = ContextVar("edited_files_that_were_accepted", default=None)


@contextmanager
def accepting_edited() -> Iterator[list[str]]:
    """Accept, within the block, files of results that were edited after they were written.

    Yields
    ------
    list of str
        Names of the edited files that the block has read so far.

    Examples
    --------
    ::

        with millfrf.accepting_edited():
            lobes = millfrf.lobes("edited_model.json", cutting="cut.toml")
    """
    names: list[str] = []
    token = _accepted.set(names)
    try:
        yield names
    finally:
        _accepted.reset(token)


def accepts_edited() -> bool:
    """Return whether edited files are accepted here."""
    return _accepted.get() is not None


def digest_of(content: Mapping[str, Any]) -> str:
    """Return the SHA-256 of JSON content without its hash.

    Examples
    --------
    >>> digest_of({"a": 1, "b": [2.5]}) == digest_of({"b": [2.5], "a": 1, HASH: "x"})
    True
    """
    rest = {key: value for key, value in content.items() if key != HASH}
    return hashlib.sha256(json.dumps(rest, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def state_of_hash(format_name: object, stated: object, actual: str) -> str:
    """Return `EDITED`, `WITHOUT_HASH`, or an empty text for content as it was written.

    Parameters
    ----------
    format_name
        Format that the file states.
    stated, actual
        Hash that the file states, None if none, and that of its content.
    """
    if stated is None:
        return WITHOUT_HASH if format_name in SEALED else ""
    return "" if stated == actual else EDITED


def require_unedited(path: str | os.PathLike[str], state: str) -> None:
    """Raise `FileFormatError` for a file that was edited, unless edited files are accepted."""
    if state != EDITED:
        return
    accepted = _accepted.get()
    if accepted is None:
        raise FileFormatError(
            f"{path} was {EDITED}, or is damaged: its content does not match its {HASH}; make it anew, or accept it as "
            "it is with --edited (in Python: with millfrf.accepting_edited())"
        )
    if Path(path).name not in accepted:
        accepted.append(Path(path).name)
