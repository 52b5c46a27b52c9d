"""A seal: bytes on disk that nobody reads before the key, kept in memory alone, opens them."""

import hashlib
import json
import secrets
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from millfrf.core import InputError, writing_whole_file

PADDED = 4096
"""Bytes of every sealed file, so that its length tells nothing."""


@dataclass(frozen=True)
class Seal:
    """Key and fingerprint that close and open a sealed file: a one-time pad, and a hash of the content.

    Parameters
    ----------
    path
        The sealed file.
    key
        As long as the file (Shannon 1949: without it the file tells nothing).
    fingerprint
        SHA-256 of the salted content, hexadecimal; to be shown beforehand.
    """

    path: Path
    key: bytes
    fingerprint: str

    def __repr__(self) -> str:
        """Show the seal without its key."""
        return f"Seal({self.path}, {self.fingerprint})"


def seal(path: Path, content: dict[str, Any]) -> Seal:
    """Write content so that only the seal returned can read it.

    Raises
    ------
    InputError
        The content is too long, or the file cannot be written.
    """
    salted = json.dumps({"salt": secrets.token_hex(32), **content}, allow_nan=False).encode()
    if len(salted) > PADDED:
        raise InputError(f"{len(salted)} bytes to seal; {PADDED} are the most")
    plain = salted.ljust(PADDED)
    key = secrets.token_bytes(PADDED)
    with writing_whole_file(path) as temporary:
        temporary.write_bytes(_either(plain, key))
    return Seal(path, key, hashlib.sha256(plain).hexdigest())


def open_seal(sealed: Seal) -> dict[str, Any]:
    """Give the content under the seal.

    Raises
    ------
    InputError
        The file is gone, or is no longer what was sealed.
    """
    try:
        hidden = sealed.path.read_bytes()
    except OSError as error:
        raise InputError(f"cannot read the sealed file {sealed.path}: {error.strerror}") from error
    plain = _either(hidden, sealed.key) if len(hidden) == PADDED else b""
    if hashlib.sha256(plain).hexdigest() != sealed.fingerprint:
        raise InputError(f"{sealed.path} has been changed since it was sealed; run the demonstration again")
    content: dict[str, Any] = json.loads(plain)
    del content["salt"]
    return content


def _either(one: bytes, other: bytes) -> bytes:
    return bytes(a ^ b for a, b in zip(one, other, strict=True))
