"""JSON files: one writer, which adds a content hash, and one reader, which compares it."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .content_hashes import HASH, digest_of, require_unedited, state_of_hash
from .errors import FileFormatError, InputError
from .whole_files import writing_whole_file

_LONGEST = 300  # digits; a floating-point number has 308 at most


def write_json(path: str | os.PathLike[str], content: Mapping[str, Any]) -> None:
    """Write a JSON file with its content hash, whole or not at all.

    Parameters
    ----------
    path
        File to write.
    content
        Fields; numbers are finite.

    Raises
    ------
    InputError
        The folder cannot be written to.
    """
    fields = json.loads(json.dumps({key: value for key, value in content.items() if key != HASH}, allow_nan=False))
    text = json.dumps({**fields, HASH: digest_of(fields)}, indent=1)
    with writing_whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def read_json(path: str | os.PathLike[str], kind: str) -> dict[str, Any]:
    """Read a JSON object, and compare its content hash if it has one.

    Parameters
    ----------
    path
        File to read.
    kind
        What the file should be and how it is made, for the messages, such as "a modal model made by fit".

    Raises
    ------
    InputError
        No such file.
    FileFormatError
        No JSON object, or it was edited after it was written (see :func:`millfrf.core.accepting_edited`).
    """
    if not Path(path).is_file():
        raise InputError(f"no file {path}; check the name")
    try:
        content = json.loads(Path(path).read_text(encoding="utf-8"), parse_int=_whole_number)
    except (ValueError, RecursionError) as error:  # ValueError: also of text that is no UTF-8
        raise FileFormatError(f"{path} is not JSON; give {kind}") from error
    if not isinstance(content, dict):
        raise FileFormatError(f"{path} holds no JSON object; give {kind}")
    require_unedited(path, json_state(content))
    return {key: value for key, value in content.items() if key != HASH}


def json_state(content: Mapping[str, Any]) -> str:
    """Return the state of the content hash of a JSON object, see :func:`millfrf.core.content_hashes.state_of_hash`."""
    return state_of_hash(content.get("format"), content.get(HASH), digest_of(content))


def _whole_number(digits: str) -> int:
    """Convert digits to a whole number that is also a floating-point number."""
    if len(digits) > _LONGEST:
        raise ValueError(f"a whole number of {len(digits)} digits")
    return int(digits)
